//! What a search renders: a scene under motions, with some settings, frame by frame.

use crate::Result;
use crate::headless::{Device, LoadedScene, Session};
use crate::metric::image::{Frame, planar};
use crate::renderer::{FrameInputs, FrameStats};
use crate::scene::Scene;
use crate::scene::motion::Motion;
use crate::scene::shot::Shot;
use crate::settings::Settings;

/// A scene on a device, with a camera.
#[derive(Debug, Clone, Copy)]
pub struct Studio<'a> {
    /// The device.
    pub device: &'a Device,
    /// The scene on it.
    pub loaded: &'a LoadedScene,
    /// The scene.
    pub scene: &'a Scene,
    /// The camera.
    pub shot: &'a Shot,
    /// Frames a second of the motions.
    pub fps: f64,
}

/// Frames of one motion, rendered one after the other.
#[derive(Debug)]
pub struct Take<'a> {
    studio: Studio<'a>,
    shot: Shot,
    session: Session,
    next: u32,
}

impl<'a> Studio<'a> {
    /// Bytes of device memory in use.
    pub fn allocated(&self) -> u64 {
        self.device.context().memory_table().values().sum()
    }

    /// From the first frame of a motion on.
    ///
    /// # Errors
    /// As for [`Session::new`].
    pub fn take(&self, settings: &Settings, motion: Motion) -> Result<Take<'a>> {
        let session = Session::new(self.device, self.loaded, settings)?;
        Ok(Take { studio: *self, shot: self.shot.with_motion(motion), session, next: 0 })
    }
}

impl Take<'_> {
    /// Renders the next frame.
    ///
    /// # Errors
    /// As for [`Session::frame`].
    pub fn frame(&mut self) -> Result<FrameStats> {
        let index = self.next;
        self.next += 1;
        self.render(index, index == 0)
    }

    /// Renders a frame of the motion, as a cut if `reset`.
    ///
    /// # Errors
    /// As for [`Session::frame`].
    pub fn render(&mut self, index: u32, reset: bool) -> Result<FrameStats> {
        let (pose, view) = self.shot.at(self.studio.scene, f64::from(index) / self.studio.fps);
        self.session.frame(&FrameInputs { view, pose: &pose, reset })
    }

    /// Begins anew, with another motion.
    pub fn rewind(&mut self, motion: Motion) {
        self.shot = self.shot.with_motion(motion);
        self.next = 0;
    }

    /// Milliseconds on the device of the last frame.
    pub fn ms(&self) -> f64 {
        self.session.phase_times().iter().map(|p| p.ms).sum()
    }

    /// The last frame, to be measured.
    ///
    /// # Errors
    /// As for [`Session::color`]; [`crate::Error::Frames`] for a pixel that is not finite.
    pub fn picture(&mut self) -> Result<Frame> {
        let color = self.session.color()?;
        Frame::from_linear([color.width, color.height], planar(color.channels, &color.data), 0.0)
    }

    /// The session.
    pub fn session(&mut self) -> &mut Session {
        &mut self.session
    }
}
