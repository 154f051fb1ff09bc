//! The shared ports of the settings, which may become free during the drive.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use ::pioneer::{Share, ShareError};

/// How often a port that cannot be opened is tried again: a program that held it is gone after seconds, and a try takes no time.
const RETRY: Duration = Duration::from_secs(1);

/// The shared ports. Without them the drive is mapped all the same.
#[derive(Debug)]
pub(super) struct Sharing {
    pub(super) share: Share,
    link: Option<PathBuf>,
    port: Option<u16>,
    tried: Instant,
    /// Why they are not open, as the log has said it.
    error: Option<String>,
}

impl Sharing {
    /// Opens the ports of the settings.
    pub(super) fn new(settings: &settings::Pioneer, now: Instant) -> Self {
        let port = settings.share_tcp.and_then(|port| u16::try_from(port.get()).ok());
        let link = settings.share.clone();
        let opened = Share::open(link.clone(), port);
        let mut sharing = Self { share: Share::default(), link, port, tried: now, error: None };
        sharing.take(opened);
        sharing
    }

    /// Tries again to open the ports that could not be opened.
    pub(super) fn retry(&mut self, now: Instant) {
        if self.error.is_some() && now.saturating_duration_since(self.tried) >= RETRY {
            self.tried = now;
            let opened = Share::open(self.link.clone(), self.port);
            self.take(opened);
        }
    }

    fn take(&mut self, opened: Result<Share, ShareError>) {
        match opened {
            Ok(share) => {
                share.names().for_each(|name| tracing::info!("the robot is shared on {name}"));
                (self.share, self.error) = (share, None);
            }
            Err(error) => {
                let error = error.to_string();
                if self.error.as_ref() != Some(&error) {
                    tracing::warn!("the robot is not shared: {error}; still trying");
                }
                self.error = Some(error);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::net::{Ipv4Addr, TcpListener};

    use super::*;

    #[test]
    fn a_port_that_becomes_free_is_shared() {
        let other = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let port = other.local_addr().unwrap().port();
        let text = format!("name = \"x\"\n[[process]]\nname = \"p\"\nrun = \"pioneer\"\n[pioneer]\nshare_tcp = {port}\n");
        let (settings, start) = (settings::Settings::parse("x.toml", &text).unwrap(), Instant::now());
        let mut sharing = Sharing::new(&settings.pioneer, start);
        let names = |sharing: &Sharing| sharing.share.names().map(str::to_owned).collect::<Vec<_>>();
        sharing.retry(start + RETRY);
        assert_eq!(names(&sharing), [""; 0], "another program has it");
        drop(other);
        sharing.retry(start + RETRY);
        assert_eq!(names(&sharing), [""; 0], "it was tried just now");
        sharing.retry(start + 2 * RETRY);
        assert_eq!(names(&sharing), [format!("127.0.0.1:{port}")]);
    }
}
