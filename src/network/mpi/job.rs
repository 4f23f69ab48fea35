//! The MPI job that started this process, as its environment tells.

use crate::error::Error;

/// The families of MPI libraries, by their binary interface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// Open MPI: handles are addresses.
    OpenMpi,
    /// MPICH and its descendants: handles are integers.
    Mpich,
}

/// A job of several processes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Job {
    /// Number of processes.
    pub size: usize,
    /// Number of this process, from 0.
    pub rank: usize,
    /// Number of this process among those on its machine, from 0.
    pub local_rank: usize,
    /// The likelier family.
    pub(super) family: Family,
}

/// The variables in which launchers tell the number of processes, and the family of the launcher.
/// Slurm's srun starts both families; with PMIx it is mostly Open MPI.
const SIZES: [(&str, Family); 4] = [
    ("OMPI_COMM_WORLD_SIZE", Family::OpenMpi),
    ("PMI_SIZE", Family::Mpich),
    ("PALS_SIZE", Family::Mpich),
    ("SLURM_STEP_NUM_TASKS", Family::OpenMpi),
];

/// The variables in which launchers tell the number of a process on its machine.
const LOCAL_RANKS: [&str; 4] = ["OMPI_COMM_WORLD_LOCAL_RANK", "MPI_LOCALRANKID", "PALS_LOCAL_RANKID", "SLURM_LOCALID"];

/// The variables in which launchers tell the number of a process.
const RANKS: [&str; 5] = ["OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK", "PALS_RANKID", "SLURM_PROCID"];

impl Job {
    /// An error that all processes have before they can talk: the first one prints it.
    pub(super) fn said_once(&self, error: Error) -> Error {
        if self.rank == 0 { error } else { Error::OtherProcess { rank: 0, code: error.exit_code() } }
    }

    /// The job that the environment `variable` describes; `None` if there is none.
    pub fn of(variable: impl Fn(&str) -> Option<String>) -> Option<Self> {
        let number = |name: &str| variable(name)?.trim().parse::<usize>().ok();
        // srun starts programs that are not of MPI, too; those of MPI have an interface to it.
        let by_slurm = variable("PMIX_RANK").is_some() || variable("PMI_RANK").is_some();
        let told = |(name, family): (&str, Family)| {
            let counts = !name.starts_with("SLURM") || by_slurm;
            number(name).filter(|_| counts).map(|size| (size, family))
        };
        let (size, family) = SIZES.into_iter().find_map(told)?;
        let local_rank = LOCAL_RANKS.into_iter().find_map(number).unwrap_or(0);
        let rank = RANKS.into_iter().find_map(number).unwrap_or(0);
        Some(Self { size, rank, local_rank, family })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn launchers_are_recognised() {
        let job = |variables: &[(&str, &str)]| {
            Job::of(|name| variables.iter().find(|(own, _)| *own == name).map(|(_, value)| (*value).to_owned()))
        };
        let of = |size, rank, family| Some(Job { size, rank, local_rank: rank, family });
        let open = [("OMPI_COMM_WORLD_SIZE", "8"), ("OMPI_COMM_WORLD_LOCAL_RANK", "3"), ("PMIX_RANK", "3")];
        assert_eq!(job(&open), of(8, 3, Family::OpenMpi));
        assert_eq!(job(&[("PMI_SIZE", "4"), ("PMI_RANK", "1"), ("MPI_LOCALRANKID", "1")]), of(4, 1, Family::Mpich));
        let slurm = [("SLURM_STEP_NUM_TASKS", "2"), ("SLURM_LOCALID", "1"), ("PMIX_RANK", "1")];
        assert_eq!(job(&slurm), of(2, 1, Family::OpenMpi));
        // A step of Slurm without MPI, and no job at all.
        assert_eq!(job(&slurm[..2]), None);
        assert_eq!(job(&[("OMPI_COMM_WORLD_SIZE", "many")]), None);
        assert_eq!(job(&[]), None);
    }
}
