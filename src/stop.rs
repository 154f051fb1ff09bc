//! `stillmap stop`: the end of a running deployment, in order.

use crate::args::Which;
use crate::output;
use crate::running::choose;
use bus::RunningDomain;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::Errno;
use rustix::process::{Pid, PidfdFlags, Signal, pidfd_open, pidfd_send_signal};

/// Requests the end of a deployment, and waits for it.
pub(crate) fn stop(which: &Which) -> anyhow::Result<()> {
    let domain = choose(which)?;
    let name = domain.name();
    let failed = |error: Errno| anyhow::anyhow!("deployment {name}, process {}: {error}", domain.pid());
    let pid = i32::try_from(domain.pid()).ok().and_then(Pid::from_raw).ok_or_else(|| failed(Errno::SRCH))?;
    let supervisor = pidfd_open(pid, PidfdFlags::empty()).map_err(failed)?;
    // Its number may be that of another process by now, unless the deployment still runs under it.
    if !RunningDomain::all()?.contains(&domain) {
        output::line(&format!("{name} has just ended"))?;
        return Ok(());
    }
    pidfd_send_signal(&supervisor, Signal::TERM).map_err(failed)?;
    loop {
        match poll(&mut [PollFd::new(&supervisor, PollFlags::IN)], None) {
            Ok(_) => break,
            Err(Errno::INTR) => {}
            Err(error) => return Err(failed(error)),
        }
    }
    output::line(&format!("{name} has ended"))?;
    Ok(())
}
