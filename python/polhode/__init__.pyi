from . import forces as forces
from . import formula as formula
from . import inertia as inertia
from . import toolkit as toolkit
from . import torques as torques
from ._engine import Engine as Engine
from ._engine import devices as devices
from ._ensemble import Ensemble as Ensemble
from ._errors import Error as Error
from ._errors import FileError as FileError
from ._errors import InputError as InputError
from ._errors import RunError as RunError
from ._free_motion import FreeMotion as FreeMotion
from ._free_motion import free_motion as free_motion
from ._native import Force as Force
from ._native import Torque as Torque
from ._observe import Event as Event
from ._observe import Histogram as Histogram
from ._observe import Quantity as Quantity
from ._report import Report as Report
from ._result import EventRecord as EventRecord
from ._result import HistogramCounts as HistogramCounts
from ._result import Result as Result
from ._result import Snapshots as Snapshots
from ._result import Survival as Survival
from ._run import Accuracy as Accuracy
from ._run import Scene as Scene
from ._run import explain as explain
from ._run import run as run
from ._run import run_study as run_study

__version__: str
__all__: list[str]
