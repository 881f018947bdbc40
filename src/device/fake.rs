//! The fake device: keeps its residency as a real one does, draws a film that tells which frame it is, and fails as it
//! is told. For tests of what stands above devices.

use super::{
    Device, DeviceError, DeviceInfo, DeviceKind, Output, RayCounts, Spans, Stop, Traced, UpdateCost,
};
use crate::film::Film;
use crate::plan::{Residency, Step, TREE_BYTES_PER_TRIANGLE, TreeState, UpdatePlan, tree_name};
use crate::scene::{Background, Frame, Object, PartHash, Shot};
use std::collections::BTreeMap;

/// How a frame fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// [`DeviceError::OutOfMemory`] when its plan is applied.
    OutOfMemory,
    /// [`DeviceError::MemoryFull`] when its plan is applied, unless all else is forgotten first.
    MemoryFull,
    /// [`DeviceError::Lost`] when it is traced; from then on all calls fail so.
    Lost,
    /// A panic when it is traced.
    Panic,
}

/// The fake device.
#[derive(Debug)]
pub struct FakeDevice {
    info: DeviceInfo,
    residency: Residency,
    faults: BTreeMap<PartHash, Fault>,
    is_lost: bool,
    /// The frame that was begun.
    traced: Option<Traced>,
}

impl FakeDevice {
    /// A device of that name that may hold so many bytes.
    pub fn new(name: &str, budget_bytes: u64) -> Self {
        let info = DeviceInfo {
            name: name.to_string(),
            kind: DeviceKind::Fake,
            description: "scripted".to_string(),
            threads: 1,
            budget_bytes,
        };
        Self { info, residency: Residency::default(), faults: BTreeMap::new(), is_lost: false, traced: None }
    }

    /// Makes a frame, named by [`Frame::hash`], fail.
    #[must_use]
    pub fn with_fault(mut self, frame: PartHash, fault: Fault) -> Self {
        self.faults.insert(frame, fault);
        self
    }

    fn out_of_memory(&self, needed_bytes: u64) -> DeviceError {
        DeviceError::OutOfMemory {
            device: self.info.name.clone(),
            needed_bytes,
            budget_bytes: self.info.budget_bytes,
        }
    }

    fn check_lost(&self) -> Result<(), DeviceError> {
        if self.is_lost {
            return Err(DeviceError::Lost { device: self.info.name.clone(), why: "scripted".to_string() });
        }
        Ok(())
    }
}

/// The colour that all pixels of a frame's picture have: the background where there is nothing to be seen, else made
/// of the frame's hash.
pub fn color_of(frame: &Frame, shot: &Shot) -> [f32; 3] {
    if frame.triangles() == 0 {
        return match shot.background {
            Background::Color(color) => color.into(),
            Background::Picture { .. } => [0.5; 3],
        };
    }
    let bits = frame.hash().0;
    [0, 8, 16].map(|shift| f32::from((bits >> shift) as u8) / 255.0)
}

impl Device for FakeDevice {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn residency(&self) -> &Residency {
        &self.residency
    }

    fn apply(&mut self, plan: &UpdatePlan, frame: &Frame) -> Result<UpdateCost, DeviceError> {
        self.check_lost()?;
        let needed_bytes = plan.needed_bytes(&self.residency);
        let is_faulty = self.faults.get(&frame.hash()) == Some(&Fault::OutOfMemory);
        if is_faulty || needed_bytes > self.info.budget_bytes {
            return Err(self.out_of_memory(needed_bytes));
        }
        if self.faults.get(&frame.hash()) == Some(&Fault::MemoryFull) && !plan.is_cold {
            let (device, what) = (self.info.name.clone(), "all".to_string());
            return Err(DeviceError::MemoryFull { device, what, needed_bytes });
        }
        let mut uploaded_bytes = 0;
        self.residency.begin(plan);
        for step in &plan.steps {
            match *step {
                Step::Free { name } => self.residency.free(name),
                Step::Evict { name } => self.residency.evict(name),
                Step::Keep { name } => self.residency.keep(name),
                Step::Upload { part, bytes } => {
                    uploaded_bytes += bytes;
                    self.residency.hold(part, bytes);
                }
                Step::Refit { from, tree, object, .. } => {
                    self.residency.refit(from, tree, &frame.objects[object].geometry, 1.0);
                }
                Step::Build { tree, triangles, object } => {
                    let state = TreeState::built(&frame.objects[object].geometry, 1.0);
                    self.residency.hold_tree(tree, triangles * TREE_BYTES_PER_TRIANGLE, state);
                }
            }
        }
        self.residency.end(plan);
        Ok(UpdateCost { uploaded_bytes, ..UpdateCost::default() })
    }

    fn begin(&mut self, frame: &Frame, shot: &Shot, _output: Output, stop: &Stop) -> Result<(), DeviceError> {
        self.check_lost()?;
        match self.faults.get(&frame.hash()) {
            Some(Fault::Panic) => panic!("{}: scripted panic", self.info.name),
            Some(Fault::Lost) => {
                self.is_lost = true;
                self.residency = Residency::default();
                self.check_lost()?;
            }
            Some(Fault::OutOfMemory | Fault::MemoryFull) | None => {}
        }
        let is_resident = |o: &Object| self.residency.held.contains_key(&tree_name(&o.geometry));
        if let Some(object) = frame.objects.iter().position(|o| !is_resident(o)) {
            return Err(DeviceError::NotResident { device: self.info.name.clone(), object });
        }
        if stop.asked() {
            return Err(DeviceError::Stopped);
        }
        let mut film = Film::new(shot.size, shot.alpha, shot.aovs);
        film.rgb.fill(color_of(frame, shot));
        self.traced = Some(Traced {
            film: film.into(),
            rays: RayCounts::default(),
            trace_ms: 0.0,
            update_ms: None,
            cost_ratio: None,
            spans: Spans::default(),
        });
        Ok(())
    }

    fn finish(&mut self) -> Result<Traced, DeviceError> {
        let why = "no frame was begun".to_string();
        self.traced.take().ok_or_else(|| DeviceError::Lost { device: self.info.name.clone(), why })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::{Wishes, plan_frame};

    fn apply(device: &mut FakeDevice, frame: &Frame) -> Result<UpdateCost, DeviceError> {
        let plan = plan_frame(frame, device.residency(), &Wishes::default());
        device.apply(&plan, frame)
    }

    #[test]
    fn it_fails_as_it_is_told() {
        let frame = Frame::default();
        let with = |fault| FakeDevice::new("fake", 100).with_fault(frame.hash(), fault);
        assert!(matches!(
            apply(&mut with(Fault::OutOfMemory), &frame),
            Err(DeviceError::OutOfMemory { budget_bytes: 100, .. })
        ));

        let shot = crate::device::conformance::shot();
        let mut lost = with(Fault::Lost);
        apply(&mut lost, &frame).unwrap();
        assert!(matches!(lost.trace(&frame, &shot, &Stop::default()), Err(DeviceError::Lost { .. })));
        assert!(matches!(apply(&mut lost, &frame), Err(DeviceError::Lost { .. })), "it stays lost");

        let mut panics = with(Fault::Panic);
        apply(&mut panics, &frame).unwrap();
        let trace = std::panic::AssertUnwindSafe(|| panics.trace(&frame, &shot, &Stop::default()).is_ok());
        assert!(std::panic::catch_unwind(trace).is_err());
    }

    #[test]
    fn other_frames_are_drawn_in_their_colour() {
        let frame = Frame::default();
        let mut device = FakeDevice::new("fake", 100).with_fault(PartHash(1), Fault::Panic);
        apply(&mut device, &frame).unwrap();
        let shot = crate::device::conformance::shot();
        let film = device.trace(&frame, &shot, &Stop::default()).unwrap().film;
        assert!(film.rgb.iter().all(|p| *p == color_of(&frame, &shot)));
    }
}
