//! Faults that can be put between the agent and its world.

use acm_actors::{episode::FaultEvent, settings::Signal};
use acm_concept::camera::{CameraError, CameraModel, CameraSource, RgbdFrame};
use std::{
    fmt,
    path::PathBuf,
    str::FromStr,
    sync::{Arc, Mutex, PoisonError},
};

/// How the fault begins that puts another memory into the run's own place.
const TRANSPLANT: &str = "transplant-memory=";
/// By how much a misplaced frame's camera is said to stand aside where the fault does not say it, millimetres.
const ASIDE_MM: u32 = 20;
/// A knock that moves a camera farther than this is a fall, millimetres.
const MAX_ASIDE_MM: u32 = 1000;

/// A fault, as `--inject` takes it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Injection {
    /// Every frame is black and without depth.
    BlackFrames,
    /// Every frame shows what the first one showed.
    FreezeFrames,
    /// A frame says that its camera stood aside of where it stood, as after a knock.
    MisplacedFrame(Misplaced),
    /// Memory is wiped once at an event.
    WipeMemory(FaultEvent),
    /// The memory in a folder takes the place of the run's own once at an event.
    TransplantMemory {
        /// The folder. It is left as it is.
        donor: PathBuf,
        /// When.
        at: FaultEvent,
    },
    /// What the hand carries is taken out of it unseen, during its nth carry from 1.
    Slip(u32),
    /// The fingers open for a moment during the nth carry from 1, and what they carry falls.
    Drop(u32),
    /// An actor fails when it is about to handle its nth message from 1. Left out of the help: it is for tests.
    Panic {
        /// The actor's role.
        role: String,
        /// Which message.
        message: u64,
    },
}

/// A frame whose camera is said to stand where it did not.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Misplaced {
    /// Which frame, from 1.
    pub frame: u32,
    /// By how much along the world's x, millimetres.
    pub aside_mm: u32,
}

impl FromStr for Misplaced {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let (frame, aside) = text.split_once(':').map_or((text, None), |(frame, aside)| (frame, Some(aside)));
        let frame = frame.parse().ok().filter(|frame| *frame > 0);
        let frame = frame.ok_or("misplaced-frame@1 is the first frame, misplaced-frame@1:50 the same by 50 mm")?;
        let aside_mm = aside.map_or(Some(ASIDE_MM), |mm| mm.parse().ok());
        let aside_mm = aside_mm.filter(|mm| (1..=MAX_ASIDE_MM).contains(mm));
        let aside_mm =
            aside_mm.ok_or(format!("a camera is misplaced by 1 to {MAX_ASIDE_MM} mm: misplaced-frame@1:50"))?;
        Ok(Misplaced { frame, aside_mm })
    }
}

impl Injection {
    /// Whether it befalls the cameras.
    pub fn is_of_cameras(&self) -> bool {
        matches!(self, Injection::BlackFrames | Injection::FreezeFrames | Injection::MisplacedFrame(_))
    }
}

impl fmt::Display for Injection {
    /// As `--inject` takes it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Injection::BlackFrames => write!(f, "black-frames"),
            Injection::FreezeFrames => write!(f, "freeze-frames"),
            Injection::MisplacedFrame(frame) => {
                write!(f, "misplaced-frame@{}:{}", frame.frame, frame.aside_mm)
            }
            Injection::WipeMemory(event) => write!(f, "wipe-memory@{event}"),
            Injection::TransplantMemory { donor, at } => write!(f, "{TRANSPLANT}{}@{at}", donor.display()),
            Injection::Slip(carry) => write!(f, "slip@{carry}"),
            Injection::Drop(carry) => write!(f, "drop@{carry}"),
            Injection::Panic { role, message } => write!(f, "panic@{role}:{message}"),
        }
    }
}

impl FromStr for Injection {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        if let Some(transplant) = text.strip_prefix(TRANSPLANT) {
            let (donor, event) =
                transplant.rsplit_once('@').filter(|(donor, _)| !donor.is_empty()).ok_or_else(|| {
                    format!("`{text}` does not name a folder and an event: write {TRANSPLANT}DIR@instruction")
                })?;
            let at = event.parse().map_err(|e: acm_actors::episode::ParseEventError| e.to_string())?;
            return Ok(Injection::TransplantMemory { donor: donor.into(), at });
        }
        match text.split_once('@') {
            None if text == "black-frames" => Ok(Injection::BlackFrames),
            None if text == "freeze-frames" => Ok(Injection::FreezeFrames),
            Some(("wipe-memory", event)) => event
                .parse()
                .map(Injection::WipeMemory)
                .map_err(|e: acm_actors::episode::ParseEventError| e.to_string()),
            Some(("misplaced-frame", frame)) => {
                frame.parse().map(Injection::MisplacedFrame).map_err(|e| format!("`{frame}`: {e}"))
            }
            Some((mishap @ ("slip" | "drop"), carry)) => match carry.parse() {
                Ok(carry) if carry > 0 && mishap == "slip" => Ok(Injection::Slip(carry)),
                Ok(carry) if carry > 0 => Ok(Injection::Drop(carry)),
                _ => Err(format!("`{carry}` is no number of a carry: write {mishap}@1 for the first")),
            },
            Some(("panic", at)) => {
                match at.split_once(':').map(|(role, message)| (role.to_string(), message.parse())) {
                    Some((role, Ok(message))) if message > 0 && crate::episode::role(&role).is_some() => {
                        Ok(Injection::Panic { role, message })
                    }
                    _ => Err(format!("`{at}` is no message of an actor: write panic@perception:3")),
                }
            }
            _ => Err(format!(
                "`{text}` is no fault: black-frames, freeze-frames, misplaced-frame@N[:MM], wipe-memory@EVENT, transplant-memory=DIR@EVENT, slip@N or drop@N"
            )),
        }
    }
}

/// The faults of one episode, sorted by where they act.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Faults {
    /// See [`Injection::BlackFrames`].
    pub black_frames: bool,
    /// See [`Injection::FreezeFrames`].
    pub freeze_frames: bool,
    /// See [`Injection::MisplacedFrame`].
    pub misplaced: Option<Misplaced>,
    /// See [`Injection::WipeMemory`].
    pub wipe_at: Option<FaultEvent>,
    /// See [`Injection::TransplantMemory`]: the folder and the event.
    pub transplant: Option<(PathBuf, FaultEvent)>,
    /// See [`Injection::Slip`].
    pub slip_at: Option<u32>,
    /// See [`Injection::Drop`].
    pub drop_at: Option<u32>,
    /// See [`Injection::Panic`].
    pub panic_at: Option<(String, u64)>,
}

impl Faults {
    /// Sorts faults; of two that exclude each other the later one holds.
    pub fn new(injections: &[Injection]) -> Faults {
        let mut faults = Faults::default();
        for injection in injections {
            match injection {
                Injection::BlackFrames => faults.black_frames = true,
                Injection::FreezeFrames => faults.freeze_frames = true,
                Injection::MisplacedFrame(frame) => faults.misplaced = Some(*frame),
                Injection::WipeMemory(event) => faults.wipe_at = Some(event.clone()),
                Injection::TransplantMemory { donor, at } => faults.transplant = Some((donor.clone(), at.clone())),
                Injection::Slip(carry) => faults.slip_at = Some(*carry),
                Injection::Drop(carry) => faults.drop_at = Some(*carry),
                Injection::Panic { role, message } => faults.panic_at = Some((role.clone(), *message)),
            }
        }
        faults
    }
    /// Puts the camera faults in front of a camera: from the first frame on, or from a signal on.
    pub fn cameras(&self, cameras: Box<dyn CameraSource>, from: Option<Signal>) -> Box<dyn CameraSource> {
        if !self.black_frames && !self.freeze_frames && self.misplaced.is_none() {
            return cameras;
        }
        Box::new(FaultyCamera { cameras, faults: self.clone(), from, first: None, given: 0 })
    }
}

/// Keeps the first or the last frames that pass, for pictures.
#[derive(Debug, Clone)]
pub struct FrameTap {
    limit: usize,
    newest: bool,
    frames: Arc<Mutex<Vec<RgbdFrame>>>,
}

impl FrameTap {
    /// Keeps the first `limit` frames.
    pub fn first(limit: usize) -> FrameTap {
        FrameTap { limit, newest: false, frames: Arc::default() }
    }
    /// Keeps the last frame.
    pub fn last() -> FrameTap {
        FrameTap { limit: 1, newest: true, frames: Arc::default() }
    }
    /// The frames so far.
    pub fn frames(&self) -> Vec<RgbdFrame> {
        self.frames.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
    /// A camera whose frames also come here.
    pub fn cameras(&self, cameras: Box<dyn CameraSource>) -> Box<dyn CameraSource> {
        Box::new(TappedCamera { cameras, tap: self.clone() })
    }
}

struct TappedCamera {
    cameras: Box<dyn CameraSource>,
    tap: FrameTap,
}

impl CameraSource for TappedCamera {
    fn cameras(&self) -> &[CameraModel] {
        self.cameras.cameras()
    }
    fn capture(&mut self, camera: &str) -> Result<RgbdFrame, CameraError> {
        let frame = self.cameras.capture(camera)?;
        let mut frames = self.tap.frames.lock().unwrap_or_else(PoisonError::into_inner);
        if self.tap.newest {
            frames.clear();
        }
        if frames.len() < self.tap.limit {
            frames.push(frame.clone());
        }
        Ok(frame)
    }
}

struct FaultyCamera {
    cameras: Box<dyn CameraSource>,
    faults: Faults,
    /// Where they begin; at once if nothing says when.
    from: Option<Signal>,
    first: Option<RgbdFrame>,
    /// Frames given since they began.
    given: u32,
}

impl CameraSource for FaultyCamera {
    fn cameras(&self) -> &[CameraModel] {
        self.cameras.cameras()
    }
    fn capture(&mut self, camera: &str) -> Result<RgbdFrame, CameraError> {
        let mut frame = self.cameras.capture(camera)?;
        if self.from.as_ref().is_some_and(|from| !from.is_given()) {
            // Frozen is the last picture before the fault.
            self.first = Some(frame.clone());
            return Ok(frame);
        }
        self.given += 1;
        if let Some(misplaced) = self.faults.misplaced.filter(|misplaced| misplaced.frame == self.given) {
            frame.header.camera_pose.translation.x += 1e-3 * f64::from(misplaced.aside_mm);
        }
        if self.faults.black_frames {
            frame.color = vec![0; frame.color.len()].into();
            frame.depth = vec![0.0; frame.depth.len()].into();
            return Ok(frame);
        }
        if self.faults.freeze_frames {
            let first = self.first.get_or_insert_with(|| frame.clone());
            frame.color = first.color.clone();
            frame.depth = first.depth.clone();
        }
        Ok(frame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use acm_concept::{
        camera::{FrameHeader, Intrinsics},
        ids::FrameId,
        pose::Pose,
        time::Time,
    };
    use glam::DVec3;

    /// Gives frames of one pixel whose ids count from 1.
    struct Counting(u32);

    impl CameraSource for Counting {
        fn cameras(&self) -> &[CameraModel] {
            &[]
        }
        fn capture(&mut self, camera: &str) -> Result<RgbdFrame, CameraError> {
            self.0 += 1;
            let header = FrameHeader {
                id: FrameId(self.0.into()),
                camera: camera.into(),
                camera_pose: Pose { translation: DVec3::new(0.1, 0.2, 0.3), ..Pose::IDENTITY },
                time: Time::ZERO,
                intrinsics: Intrinsics { width: 1, height: 1, fx: 1.0, fy: 1.0, cx: 0.0, cy: 0.0 },
            };
            Ok(RgbdFrame { header, color: vec![0; 3].into(), depth: vec![1.0].into() })
        }
    }

    #[test]
    fn only_the_one_frame_is_said_to_stand_aside() {
        let mut cameras = Faults::new(&["misplaced-frame@2:50".parse().unwrap()]).cameras(Box::new(Counting(0)), None);
        let mut stood = |_| cameras.capture("head").map(|frame| frame.header.camera_pose.translation).unwrap();
        let stands = [1, 2, 3].map(&mut stood);
        let nominal = DVec3::new(0.1, 0.2, 0.3);
        assert_eq!(stands, [nominal, nominal + DVec3::new(0.05, 0.0, 0.0), nominal]);
    }

    #[test]
    fn faults_are_read_and_mistakes_named() {
        assert_eq!(["slip@2", "drop@1"].map(str::parse), [Ok(Injection::Slip(2)), Ok(Injection::Drop(1))]);
        assert_eq!("wipe-memory@instruction".parse(), Ok(Injection::WipeMemory(FaultEvent::Instruction)));
        assert_eq!("panic@memory:4".parse(), Ok(Injection::Panic { role: "memory".into(), message: 4 }));
        for word in [
            "black-frames",
            "freeze-frames",
            "misplaced-frame@2:20",
            "wipe-memory@first-verified-place",
            "transplant-memory=a@b/c@instruction",
            "slip@2",
            "panic@memory:4",
        ] {
            assert_eq!(word.parse::<Injection>().map(|fault| fault.to_string()), Ok(word.into()));
        }
        for bad in [
            "panic@memory",
            "panic@butler:1",
            "panic@memory:0",
            "slip@0",
            "slip",
            "wipe-memory@noon",
            "white-frames",
            "transplant-memory=@instruction",
            "transplant-memory=there",
            "transplant-memory=there@noon",
            "misplaced-frame@0",
            "misplaced-frame@1:0",
            "misplaced-frame@1:9999",
        ] {
            assert!(bad.parse::<Injection>().is_err(), "{bad}");
        }
    }
}
