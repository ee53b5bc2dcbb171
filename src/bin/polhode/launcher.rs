//! Which part of a study this process runs, according to its launcher's environment variables.

use polhode::record::Shard;

/// The values of `--shard`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShardArgument {
    /// `3/64`.
    Given(Shard),
    /// `auto`, or `auto/64` with the number of parts.
    Auto(Option<usize>),
}

/// Parses `--shard`.
pub fn shard_argument(text: &str) -> Result<ShardArgument, String> {
    const EXPECTED: &str = "expected INDEX/COUNT, such as 3/64 with INDEX from 1 to COUNT, auto, or auto/COUNT";
    let refused = || EXPECTED.to_owned();
    match text.split_once('/') {
        None if text == "auto" => Ok(ShardArgument::Auto(None)),
        Some(("auto", count)) => {
            let count = count.parse().ok().filter(|&count: &usize| count > 0);
            count.map(|count| ShardArgument::Auto(Some(count))).ok_or_else(refused)
        }
        _ => text.parse().map(ShardArgument::Given).map_err(|_| refused()),
    }
}

/// A launcher, and the variables that identify it.
struct Launcher {
    name: &'static str,
    index: &'static str,
    /// The variables of the least and the greatest index, if the launcher sets them; the former is `None` if indices count from 0.
    range: Option<(Option<&'static str>, &'static str)>,
    /// Whether its variables exist only if it has started several processes.
    is_parallel: bool,
}

/// Inner ones first: an MPI process may run in a task of an array.
const LAUNCHERS: [Launcher; 8] = [
    Launcher {
        name: "Open MPI",
        index: "OMPI_COMM_WORLD_RANK",
        range: Some((None, "OMPI_COMM_WORLD_SIZE")),
        is_parallel: true,
    },
    Launcher { name: "MPI (PMI)", index: "PMI_RANK", range: Some((None, "PMI_SIZE")), is_parallel: true },
    Launcher { name: "HyperQueue", index: "HQ_TASK_ID", range: None, is_parallel: false },
    Launcher {
        name: "Slurm array",
        index: "SLURM_ARRAY_TASK_ID",
        range: Some((Some("SLURM_ARRAY_TASK_MIN"), "SLURM_ARRAY_TASK_MAX")),
        is_parallel: false,
    },
    Launcher { name: "PBS array", index: "PBS_ARRAY_INDEX", range: None, is_parallel: false },
    Launcher { name: "PBS array", index: "PBS_ARRAYID", range: None, is_parallel: false },
    Launcher {
        name: "Grid Engine array",
        index: "SGE_TASK_ID",
        range: Some((Some("SGE_TASK_FIRST"), "SGE_TASK_LAST")),
        is_parallel: false,
    },
    Launcher { name: "srun", index: "SLURM_PROCID", range: Some((None, "SLURM_NTASKS")), is_parallel: true },
];

/// The part, and a description of where it was found.
pub fn find(count: Option<usize>, variable: impl Fn(&str) -> Option<String>) -> Result<(Shard, String), String> {
    let number = |name: &str| variable(name).and_then(|text| text.parse::<usize>().ok());
    let is_there = |launcher: &&Launcher| {
        // Grid Engine sets "undefined" if there is no array.
        number(launcher.index).is_some()
            && (!launcher.is_parallel
                || launcher.range.is_some_and(|(_, most)| number(most).is_some_and(|most| most > 1)))
    };
    let mut there = LAUNCHERS.iter().filter(is_there);
    let Some(launcher) = there.next() else {
        let names: Vec<&str> = LAUNCHERS.iter().map(|launcher| launcher.index).collect();
        return Err(format!(
            "no launcher says which part this is (none of {} is set): give --shard INDEX/COUNT",
            names.join(", ")
        ));
    };
    let Launcher { name, index, range, is_parallel } = launcher;
    let place = number(index).unwrap_or_default();
    let from = format!("{name}, {index}={place}");
    if *is_parallel && let Some(outer) = there.find(|other| !other.is_parallel) {
        return Err(format!(
            "{from} and {} ({}) both number this process: give --shard INDEX/COUNT",
            outer.name, outer.index
        ));
    }
    let (place, known) = match range {
        Some((None, most)) => (place + 1, number(most)),
        Some((Some(least), most)) => match (number(least), number(most)) {
            // If only a part of an array is run again, neither number says how many parts there are.
            (Some(1), Some(most)) if count.is_none() => {
                let tasks = number("SLURM_ARRAY_TASK_COUNT").unwrap_or(most);
                if tasks != most {
                    return Err(format!(
                        "{from}: an array of {tasks} tasks up to {most} has gaps: give --shard auto/COUNT"
                    ));
                }
                (place, Some(most))
            }
            (Some(least), _) if count.is_none() => {
                return Err(format!("{from}: expected an array from 1 on, not from {least}, or --shard auto/COUNT"));
            }
            _ => (place, None),
        },
        None => (place, None),
    };
    let count = match (count, known) {
        (Some(count), Some(known)) if count != known && *is_parallel => {
            return Err(format!(
                "{from} of {known} processes: expected --shard auto, or as many processes as parts ({count})"
            ));
        }
        (Some(count), _) | (None, Some(count)) => count,
        (None, None) => {
            return Err(format!("{from}: it does not say how many parts there are: give --shard auto/COUNT"));
        }
    };
    let shard = Shard::new(place, count).ok_or_else(|| match is_parallel {
        // Ranks count from 0.
        true => format!("{from}: expected a rank below {count}"),
        false => format!("{from}: expected an index from 1 to {count}: number the tasks from 1 on"),
    })?;
    Ok((shard, from))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(count: Option<usize>, set: &[(&str, &str)]) -> Result<String, String> {
        let variable = |name: &str| set.iter().find(|(own, _)| *own == name).map(|(_, value)| (*value).to_owned());
        find(count, variable).map(|(shard, from)| format!("{shard} {from}"))
    }

    #[test]
    fn launchers_are_told_by_their_variables() {
        let slurm = |id, least, most, count| {
            [
                ("SLURM_ARRAY_TASK_ID", id),
                ("SLURM_ARRAY_TASK_MIN", least),
                ("SLURM_ARRAY_TASK_MAX", most),
                ("SLURM_ARRAY_TASK_COUNT", count),
                ("SLURM_PROCID", "0"),
                ("SLURM_NTASKS", "1"),
            ]
        };
        let name = "Slurm array, SLURM_ARRAY_TASK_ID";
        assert_eq!(found(None, &slurm("3", "1", "64", "64")), Ok(format!("3/64 {name}=3")));
        assert_eq!(found(Some(64), &slurm("7", "3", "9", "4")), Ok(format!("7/64 {name}=7")));
        let refused = |count, set: &[(&str, &str)], word: &str| {
            let error = found(count, set).expect_err(word);
            assert!(error.contains(word), "{error}");
        };
        refused(None, &slurm("7", "3", "9", "4"), "auto/COUNT");
        refused(None, &slurm("7", "1", "9", "4"), "has gaps");
        refused(None, &slurm("0", "0", "63", "64"), "not from 0");
        refused(Some(64), &slurm("0", "0", "63", "64"), "from 1 on");
        assert_eq!(found(Some(8), &[("HQ_TASK_ID", "8")]), Ok("8/8 HyperQueue, HQ_TASK_ID=8".to_owned()));
        refused(None, &[("HQ_TASK_ID", "8")], "auto/COUNT");
        assert_eq!(found(Some(9), &[("PBS_ARRAY_INDEX", "2")]), Ok("2/9 PBS array, PBS_ARRAY_INDEX=2".to_owned()));
        let mpi = [("OMPI_COMM_WORLD_RANK", "0"), ("OMPI_COMM_WORLD_SIZE", "4")];
        assert_eq!(found(None, &mpi), Ok("1/4 Open MPI, OMPI_COMM_WORLD_RANK=0".to_owned()));
        assert_eq!(found(Some(4), &mpi), Ok("1/4 Open MPI, OMPI_COMM_WORLD_RANK=0".to_owned()));
        refused(Some(5), &mpi, "as many processes as parts");
        refused(None, &[mpi[0], mpi[1], ("SLURM_ARRAY_TASK_ID", "1")], "both number");
        let pmi = [("PMI_RANK", "6"), ("PMI_SIZE", "7")];
        assert_eq!(found(None, &pmi), Ok("7/7 MPI (PMI), PMI_RANK=6".to_owned()));
        refused(None, &[("PMI_RANK", "2"), ("PMI_SIZE", "2")], "PMI_RANK=2: expected a rank below 2");
        assert_eq!(
            found(None, &[("SLURM_PROCID", "1"), ("SLURM_NTASKS", "2")]),
            Ok("2/2 srun, SLURM_PROCID=1".to_owned())
        );
        refused(None, &[("SGE_TASK_ID", "undefined")], "no launcher");
        refused(None, &[], "no launcher");
    }

    #[test]
    fn arguments_are_read() {
        assert_eq!(shard_argument("auto"), Ok(ShardArgument::Auto(None)));
        assert_eq!(shard_argument("auto/64"), Ok(ShardArgument::Auto(Some(64))));
        assert_eq!(shard_argument("3/64"), Ok(ShardArgument::Given(Shard::new(3, 64).expect("a shard"))));
        for wrong in ["", "auto/", "auto/0", "0/4", "5/4", "automatic"] {
            assert!(shard_argument(wrong).is_err(), "{wrong}");
        }
    }
}
