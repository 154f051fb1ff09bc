//! What keeps a camera from giving pictures, by what can be done about it.

use rustix::io::Errno;

use crate::four_cc::FourCc;

/// Why a device gives no pictures. Its words follow the name of the device.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Trouble {
    /// There is no such device, or no longer.
    #[error("no such device: is the camera plugged in? `stillmap camera list` shows what there is")]
    Absent,
    /// This user may not open it.
    #[error("permission denied: is this user in the group that may use it (video)?")]
    Forbidden,
    /// Another program is taking pictures with it.
    #[error("in use by another program")]
    Busy,
    /// It is not a camera, or not one that streams.
    #[error("not a camera that streams pictures")]
    NotACamera,
    /// It has no such input.
    #[error("no input {wanted}: it has {count}, numbered from 0")]
    Input {
        /// The input asked for.
        wanted: u32,
        /// How many it has.
        count: u32,
    },
    /// It answers every format asked for with another one.
    #[error("refuses the format {wanted} and gives {found}: `stillmap camera list` shows what it offers")]
    Format {
        /// The formats asked for.
        wanted: String,
        /// What it would give.
        found: FourCc,
    },
    /// It has no pictures of the size asked for.
    #[error(
        "gives {} × {}, not the {} × {} asked for: `stillmap camera list` shows what it offers",
        found.0, found.1, wanted.0, wanted.1
    )]
    Size {
        /// Width and height asked for.
        wanted: (u32, u32),
        /// What it would give.
        found: (u32, u32),
    },
    /// Its rows are shorter than its pictures are wide.
    #[error("claims rows of {stride} bytes, which is less than the {row} of {width} pixels")]
    Stride {
        /// Bytes from one row to the next.
        stride: u32,
        /// Bytes that a row needs.
        row: u32,
        /// Pixels in a row.
        width: u32,
    },
    /// The stream broke and has to be started again.
    #[error("the stream broke ({call}: {error})")]
    Broken {
        /// The call that failed.
        call: &'static str,
        /// What the system says.
        error: Errno,
    },
    /// Anything else that a call failed with.
    #[error("{call} failed: {error}")]
    Failed {
        /// The call.
        call: &'static str,
        /// What the system says.
        error: Errno,
    },
}

impl Trouble {
    /// What it means that a call on the device failed.
    #[must_use]
    pub fn of(call: &'static str, error: Errno) -> Self {
        match error {
            Errno::NOENT | Errno::NODEV | Errno::NXIO => Self::Absent,
            Errno::ACCESS | Errno::PERM => Self::Forbidden,
            Errno::BUSY => Self::Busy,
            Errno::NOTTY => Self::NotACamera,
            Errno::IO => Self::Broken { call, error },
            error => Self::Failed { call, error },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_told_by_what_can_be_done_about_them() {
        assert_eq!(Trouble::of("open", Errno::NOENT), Trouble::Absent);
        assert_eq!(Trouble::of("VIDIOC_DQBUF", Errno::NODEV), Trouble::Absent);
        assert_eq!(Trouble::of("open", Errno::ACCESS), Trouble::Forbidden);
        assert_eq!(Trouble::of("VIDIOC_S_FMT", Errno::BUSY), Trouble::Busy);
        assert!(matches!(Trouble::of("VIDIOC_DQBUF", Errno::IO), Trouble::Broken { .. }));
        assert_eq!(Trouble::of("VIDIOC_STREAMON", Errno::INVAL).to_string(), "VIDIOC_STREAMON failed: Invalid argument (os error 22)");
        assert_eq!(
            Trouble::Size { wanted: (160, 120), found: (320, 180) }.to_string(),
            "gives 320 × 180, not the 160 × 120 asked for: `stillmap camera list` shows what it offers"
        );
    }
}
