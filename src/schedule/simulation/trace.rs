//! Made traces: devices, and jobs that come. Ranges are those of the scenes measured so far: 2 to 30 ms for a warm frame,
//! 0.1 to 2 s for a cold start, 20 to 1,500 frames.

use super::random::Random;

/// A job as it is, and as it is thought to be when it comes.
#[derive(Clone, Debug, PartialEq)]
pub struct TraceJob {
    /// When it comes, in seconds.
    pub arrives_s: f64,
    /// Frames.
    pub frames: u64,
    /// Seconds of a frame on a device of speed 1.
    pub warm_s: f64,
    /// Seconds of a cold start there.
    pub cold_s: f64,
    /// Bytes on a device.
    pub bytes: u64,
    /// How many times longer than they are its frames and its cold start are thought to take.
    pub seen: [f64; 2],
    /// When it is wanted, seconds after it comes.
    pub deadline_s: Option<f64>,
}

/// A device as it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TraceDevice {
    /// How many times faster than the first it traces.
    pub speed: f64,
    /// Bytes that it holds.
    pub budget_bytes: u64,
    /// From when on everything takes so many times longer; nobody is told.
    pub slows: Option<(f64, f64)>,
    /// When it fails.
    pub fails_s: Option<f64>,
}

impl TraceDevice {
    /// How many times longer a cold start takes than on a device of speed 1: half of it is reading, which is the
    /// machine's.
    pub fn cold_factor(&self) -> f64 {
        0.5 + 0.5 / self.speed
    }
}

/// What is simulated.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    /// By the time they come.
    pub jobs: Vec<TraceJob>,
    /// The devices.
    pub devices: Vec<TraceDevice>,
}

/// Bytes for each second of a cold start: 1 GB.
const BYTES_PER_S: f64 = 1e9;

/// Kinds of traces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// Three jobs of 1,500 to 6,000 frames on four devices.
    FewLong,
    /// 400 jobs of 5 to 60 frames.
    ManyShort,
    /// 40 jobs, log-uniform in everything.
    Mixed,
    /// The same on devices of speeds 1, 1, 0.5 and 0.1.
    Unequal,
    /// 120 jobs in bursts of ten.
    Bursts,
    /// 60 jobs that come one by one, at 70 % of what the devices can do.
    Arrivals,
    /// A giant scene among twenty small ones.
    Giant,
    /// Mixed jobs with deadlines of twice to ten times what they take alone.
    Deadlines,
    /// Mixed; a device has room for two scenes of the largest.
    TwoScenes,
    /// Mixed; one device of four takes ten times longer from a third of the time on.
    Slows,
    /// Mixed; one device of four fails at half time.
    Fails,
    /// Mixed; frames and cold starts are thought to take up to three times more or less.
    WrongByThree,
    /// Arrivals; a device has room for the largest scene and no more.
    OneScene,
    /// A giant scene, and small ones that come while it is traced; a device has room for it alone.
    GiantAlone,
}

impl Family {
    /// All of them.
    pub const ALL: [Self; 14] = [
        Self::FewLong,
        Self::ManyShort,
        Self::Mixed,
        Self::Unequal,
        Self::Bursts,
        Self::Arrivals,
        Self::Giant,
        Self::Deadlines,
        Self::TwoScenes,
        Self::Slows,
        Self::Fails,
        Self::WrongByThree,
        Self::OneScene,
        Self::GiantAlone,
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::FewLong => "few long",
            Self::ManyShort => "many short",
            Self::Mixed => "mixed",
            Self::Unequal => "unequal devices",
            Self::Bursts => "bursts",
            Self::Arrivals => "arrivals",
            Self::Giant => "one giant",
            Self::Deadlines => "deadlines",
            Self::TwoScenes => "memory for two",
            Self::OneScene => "memory for one",
            Self::GiantAlone => "memory for the giant",
            Self::Slows => "one slows down",
            Self::Fails => "one fails",
            Self::WrongByThree => "estimates wrong",
        }
    }

    /// A trace of it; equal seeds make equal traces.
    pub fn trace(self, seed: u64) -> Trace {
        let mut random = Random::new(seed ^ ((self as u64) << 32));
        let equal = vec![device(1.0); 4];
        match self {
            Self::FewLong => Trace { jobs: jobs(&mut random, 3, [1500.0, 6000.0]), devices: equal },
            Self::ManyShort => Trace { jobs: jobs(&mut random, 400, [5.0, 60.0]), devices: equal },
            Self::Mixed => Trace { jobs: mixed(&mut random, 40), devices: equal },
            Self::Unequal => {
                Trace { jobs: mixed(&mut random, 40), devices: [1.0, 1.0, 0.5, 0.1].map(device).to_vec() }
            }
            Self::Bursts => {
                let mut jobs = mixed(&mut random, 120);
                let pause_s = work_s(&jobs) / 12.0 / 4.0 / 0.7;
                let mut at_s = 0.0;
                for burst in jobs.chunks_mut(10) {
                    for job in burst {
                        job.arrives_s = at_s;
                    }
                    at_s += random.exponential(pause_s);
                }
                Trace { jobs, devices: equal }
            }
            Self::Arrivals => Trace { jobs: arriving(&mut random), devices: equal },
            Self::Giant => {
                let mut jobs = jobs(&mut random, 20, [20.0, 200.0]);
                for job in &mut jobs {
                    (job.cold_s, job.bytes) = (job.cold_s / 4.0, job.bytes / 4);
                }
                let giant =
                    TraceJob { frames: 8000, warm_s: 0.03, cold_s: 4.0, bytes: 4_000_000_000, ..jobs[0] };
                jobs.insert(10, giant);
                Trace { jobs, devices: equal }
            }
            Self::Deadlines => {
                let mut jobs = mixed(&mut random, 40);
                for job in &mut jobs {
                    let alone_s = job.frames as f64 * job.warm_s / 4.0 + job.cold_s;
                    job.deadline_s = Some(alone_s * random.log_uniform(2.0, 10.0));
                }
                Trace { jobs, devices: equal }
            }
            Self::TwoScenes => {
                let jobs = mixed(&mut random, 40);
                let largest = jobs.iter().map(|j| j.bytes).max().unwrap_or(0);
                let devices = vec![TraceDevice { budget_bytes: 2 * largest, ..device(1.0) }; 4];
                Trace { jobs, devices }
            }
            Self::OneScene => {
                let jobs = arriving(&mut random);
                let largest = jobs.iter().map(|j| j.bytes).max().unwrap_or(0);
                let devices = vec![TraceDevice { budget_bytes: largest, ..device(1.0) }; 4];
                Trace { jobs, devices }
            }
            Self::GiantAlone => {
                let Trace { mut jobs, .. } = Self::Giant.trace(seed);
                jobs.swap(0, 10);
                let pause_s = jobs[0].frames as f64 * jobs[0].warm_s / 4.0 / 20.0;
                one_by_one(&mut random, &mut jobs, pause_s);
                let devices = vec![TraceDevice { budget_bytes: jobs[0].bytes, ..device(1.0) }; 4];
                Trace { jobs, devices }
            }
            Self::Slows => {
                let jobs = mixed(&mut random, 40);
                let mut devices = equal;
                devices[1].slows = Some((work_s(&jobs) / 4.0 / 3.0, 10.0));
                Trace { jobs, devices }
            }
            Self::Fails => {
                let jobs = mixed(&mut random, 40);
                let mut devices = equal;
                devices[1].fails_s = Some(work_s(&jobs) / 4.0 / 2.0);
                Trace { jobs, devices }
            }
            Self::WrongByThree => {
                let mut jobs = mixed(&mut random, 40);
                for job in &mut jobs {
                    job.seen = [(); 2].map(|()| random.log_uniform(1.0 / 3.0, 3.0));
                }
                Trace { jobs, devices: equal }
            }
        }
    }
}

/// A mixed trace of so many jobs, all at once, on so many equal devices.
pub fn load(jobs: usize, devices: usize, seed: u64) -> Trace {
    let mut random = Random::new(seed ^ ((jobs as u64) << 20) ^ ((devices as u64) << 40));
    Trace { jobs: mixed(&mut random, jobs), devices: vec![device(1.0); devices] }
}

fn device(speed: f64) -> TraceDevice {
    TraceDevice { speed, budget_bytes: u64::MAX, slows: None, fails_s: None }
}

/// Few long ones, many short.
fn mixed(random: &mut Random, count: usize) -> Vec<TraceJob> {
    jobs(random, count, [20.0, 1500.0])
}

fn jobs(random: &mut Random, count: usize, [least, most]: [f64; 2]) -> Vec<TraceJob> {
    let job = |random: &mut Random| {
        let cold_s = random.log_uniform(0.1, 2.0);
        TraceJob {
            arrives_s: 0.0,
            frames: random.log_uniform(least, most) as u64,
            warm_s: random.log_uniform(0.002, 0.03),
            cold_s,
            bytes: (cold_s * BYTES_PER_S) as u64,
            seen: [1.0; 2],
            deadline_s: None,
        }
    };
    (0..count).map(|_| job(random)).collect()
}

/// Mixed jobs that come one by one, at 70 % of what four devices can do.
fn arriving(random: &mut Random) -> Vec<TraceJob> {
    let mut jobs = mixed(random, 60);
    let pause_s = work_s(&jobs) / 60.0 / 4.0 / 0.7;
    one_by_one(random, &mut jobs, pause_s);
    jobs
}

/// Lets jobs come with so long between them on average.
fn one_by_one(random: &mut Random, jobs: &mut [TraceJob], pause_s: f64) {
    let mut at_s = 0.0;
    for job in jobs {
        job.arrives_s = at_s;
        at_s += random.exponential(pause_s);
    }
}

/// Seconds that a device of speed 1 would take for all of it.
fn work_s(jobs: &[TraceJob]) -> f64 {
    jobs.iter().map(|j| j.frames as f64 * j.warm_s + j.cold_s).sum()
}
