//! From a bag to a log.

use std::fs::{self, File};
use std::io::Write;
use std::path::Path;

use drivelog::{LogError, Preamble, Recording};
use messages::{CameraFrame, FrameLayout, Pose, SonarScan};

use crate::bag::Bag;
use crate::error::BagError;
use crate::message::Topic;
use crate::picture::picture;
use crate::scans::scans;
use crate::survey::Survey;

/// What came of an import.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Imported {
    /// Scans in the log.
    pub scans: u64,
    /// Readings in them.
    pub readings: u64,
    /// Pictures in the log.
    pub pictures: u64,
    /// What was left out, and why.
    pub left_out: Vec<String>,
}

/// Writes a log of a surveyed bag into the new file `to`. The preamble has the mounts of the sonars in their order.
///
/// # Errors
/// When the bag cannot be read, has no scan, or the log cannot be written or exists already; an unfinished log is removed.
pub fn import(bag: &Bag, survey: Survey, preamble: &Preamble, to: &Path) -> Result<Imported, BagError> {
    let mut file = File::create_new(to).map_err(BagError::io(to))?;
    write(bag, survey, preamble, to, &mut file).inspect_err(|_| {
        // The first failure is the one to tell.
        let _ = fs::remove_file(to);
    })
}

fn write(bag: &Bag, survey: Survey, preamble: &Preamble, to: &Path, file: &mut File) -> Result<Imported, BagError> {
    let mut tally = survey.tally;
    let mounted: Vec<(String, Pose)> =
        survey.sonars.iter().zip(&preamble.sonars).map(|(sonar, mount)| (sonar.topic.clone(), *mount)).collect();
    let scans = scans(&survey.readings, &survey.trajectory, &mounted, &mut tally);
    let readings = scans.iter().map(|(_, scan)| scan.readings().len() as u64).sum();
    if scans.is_empty() || readings == 0 {
        return Err(BagError::Missing("readings at times that its odometry covers"));
    }
    let mut log = LogOfBag { recording: Recording::new(preamble).map_err(LogError::writing(to))?, file, to, scans: &scans, sent: 0 };
    let mut pictures = (0, 0);
    if let Some(camera) = &survey.camera {
        let wants = |topic: &Topic| topic.name == camera.topic;
        bag.visit(&wants, &mut |message| {
            let problem = match message.data().and_then(|data| picture(&message.topic.type_name, &data)) {
                Err(problem) => problem,
                Ok(picture) => {
                    let stamp_ns = picture.header.stamp_or(message.received_ns);
                    if picture.layout != camera.layout {
                        "pictures of another size than the first are left out".to_owned()
                    } else if stamp_ns <= pictures.1 {
                        "pictures that are not newer than the one before are left out".to_owned()
                    } else {
                        pictures = (pictures.0 + 1, stamp_ns);
                        return log.picture(pictures.0, stamp_ns, &picture.layout, &picture.bytes);
                    }
                }
            };
            tally.add(&camera.topic, &problem);
            Ok(())
        })?;
    }
    log.finish(pictures)?;
    let left_out = survey.damages.lines().into_iter().chain(tally.lines()).collect();
    Ok(Imported { scans: scans.len() as u64, readings, pictures: pictures.0, left_out })
}

/// A log into which scans and pictures go in the order of their stamps.
struct LogOfBag<'a> {
    recording: Recording,
    file: &'a mut File,
    to: &'a Path,
    scans: &'a [(u64, SonarScan)],
    /// Scans that are in the log.
    sent: usize,
}

impl LogOfBag<'_> {
    fn picture(&mut self, seq: u64, stamp_ns: u64, layout: &FrameLayout, bytes: &[u8]) -> Result<(), BagError> {
        self.scans_up_to(stamp_ns)?;
        self.recording.picture::<CameraFrame>(seq, stamp_ns, layout, bytes).map_err(LogError::writing(self.to))?;
        self.append()
    }

    fn scans_up_to(&mut self, stamp_ns: u64) -> Result<(), BagError> {
        while let Some((scan_ns, scan)) = self.scans.get(self.sent).filter(|(scan_ns, _)| *scan_ns <= stamp_ns) {
            self.sent += 1;
            self.recording.scan(self.sent as u64, *scan_ns, scan).map_err(LogError::writing(self.to))?;
            self.append()?;
        }
        Ok(())
    }

    fn append(&mut self) -> Result<(), BagError> {
        self.file.write_all(&self.recording.take()).map_err(BagError::io(self.to))
    }

    /// Ends the log after so many pictures, the last of which has this stamp.
    fn finish(mut self, (pictures, last_ns): (u64, u64)) -> Result<(), BagError> {
        self.scans_up_to(u64::MAX)?;
        let end_ns = self.scans.last().map_or(0, |(stamp_ns, _)| *stamp_ns);
        self.recording.end::<SonarScan>(self.scans.len() as u64, end_ns).map_err(LogError::writing(self.to))?;
        if pictures > 0 {
            self.recording.end_of_pictures::<CameraFrame>(pictures, last_ns).map_err(LogError::writing(self.to))?;
        }
        let rest = self.recording.finish().map_err(LogError::writing(self.to))?;
        self.file.write_all(&rest).map_err(BagError::io(self.to))
    }
}
