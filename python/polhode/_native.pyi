"""What of the extension module users meet; the modules beside it call the rest."""

from typing import Any, final

__version__: str

@final
class Torque:
    @property
    def name(self) -> str: ...
    @property
    def dissipative(self) -> bool: ...

@final
class Force:
    @property
    def name(self) -> str: ...

def __getattr__(name: str) -> Any: ...
