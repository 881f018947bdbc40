//! What frames cost, before they are read, traced and written: for each term the units of work that it has (bytes,
//! triangles, pixels, samples) times a rate. A rate is assumed at first, corrected by what earlier runs measured on the same
//! device, and within a run by what its own frames measure; each correction is the median of the latest few.

mod rate;
mod thesis;

pub use thesis::Thesis;

use rate::Rate;
use std::collections::BTreeMap;

/// How far from what is assumed a rate is expected to be, of which nothing was measured: the logarithm of a factor 2.
const ASSUMED_SPREAD: f64 = std::f64::consts::LN_2;

/// Whose rates they are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Speeds {
    /// A reader or writer of the host.
    Host,
    /// A CPU's threads.
    Cpu(usize),
    /// A GPU.
    Gpu,
}

/// Parts of a frame's cost, seconds but where it says otherwise, with their units of work.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Term<'a> {
    /// Reading files: bytes.
    Read,
    /// Parsing them: bytes.
    Parse,
    /// Parsing them with another frame of the sequence at hand: bytes.
    Reparse,
    /// Taking from the store what was parsed of them: bytes.
    Restore,
    /// Posing what was parsed before: triangles.
    Pose,
    /// Making a picture file of a film, by its format: pixels.
    Encode(&'a str),
    /// Writing that: pixels.
    Write(&'a str),
    /// Handing parts to a device: bytes.
    Upload,
    /// Building trees: triangles.
    Build,
    /// Refitting them: triangles.
    Refit,
    /// Tracing and shading: [`trace_work`]. What mirrors and glass take beside it is not seen from a scene's counts.
    Trace {
        /// Whether anything reflects or lets through.
        is_deep: bool,
    },
    /// Bytes of trees: their bytes as they are reckoned before they are built.
    TreeBytes,
    /// Bytes of the host's memory: bytes of the frames that are on their way, and of what CPU devices hold.
    HostBytes,
}

impl Term<'_> {
    /// The name under which its rate is kept.
    fn name(self) -> String {
        match self {
            Self::Encode(format) => format!("encode {format}"),
            // as `write` it was kept for each pixel, however few
            Self::Write(format) => format!("file {format}"),
            Self::Trace { is_deep: true } => "trace deep".to_string(),
            Self::Trace { is_deep: false } => "trace".to_string(),
            other => format!("{other:?}").to_lowercase(),
        }
    }

    /// What each unit is assumed to take, by orders of magnitude, and the units that there are at the least.
    fn assumed(self, speeds: Speeds) -> (f64, f64) {
        let threads = match speeds {
            Speeds::Cpu(threads) => threads.max(1) as f64,
            Speeds::Host | Speeds::Gpu => 1.0,
        };
        let is_gpu = speeds == Speeds::Gpu;
        match self {
            Self::Read | Self::Reparse => (0.5e-9, 65536.0),
            Self::Parse => (2e-9, 65536.0),
            Self::Restore => (0.2e-9, 65536.0),
            Self::Pose => (30e-9, 256.0),
            Self::Encode(_) => (8e-9, 4096.0),
            // the record and the picture are flushed, for which the size of a file hardly matters: 4 ms
            Self::Write(_) => (1e-9, 4e6),
            Self::Upload if is_gpu => (0.1e-9, 1e6),
            // a reference, however much it refers to
            Self::Upload => (5e-18, 1e12),
            Self::Build => (400e-9 / threads, 256.0),
            Self::Refit if is_gpu => (0.2e-9, 65536.0),
            Self::Refit => (30e-9 / threads, 256.0),
            Self::Trace { is_deep } => {
                let deep = if is_deep { 4.0 } else { 1.0 };
                if is_gpu { (deep * 0.02e-9, 5e6) } else { (deep * 2e-9 / threads, 65536.0) }
            }
            Self::TreeBytes | Self::HostBytes => (1.0, 0.0),
        }
    }
}

/// The work of tracing so many samples in scenes of so many triangles with so many lights: a ray descends the tree level by
/// level, and asks each light.
pub fn trace_work(samples: f64, triangles: u64, lights: usize) -> f64 {
    samples * (8.0 + (triangles as f64 + 1.0).log2()) * (1.0 + 0.3 * lights as f64)
}

/// What is expected of a term.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Expected {
    /// Seconds or bytes.
    pub value: f64,
    /// About how far off it may be, to either side.
    pub error: f64,
}

impl std::iter::Sum for Expected {
    /// Errors of terms are taken as independent.
    fn sum<I: Iterator<Item = Self>>(terms: I) -> Self {
        let add = |[value, square]: [f64; 2], t: Self| [value + t.value, square + t.error * t.error];
        let [value, square] = terms.fold([0.0; 2], add);
        Self { value, error: square.sqrt() }
    }
}

/// The rates of the host or of one device.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimates {
    speeds: Speeds,
    /// Of earlier runs: over what is assumed, one value a run.
    past: BTreeMap<String, Rate>,
    /// Of this one: over what the past says.
    now: BTreeMap<String, Rate>,
}

impl Estimates {
    /// With what [`Self::kept`] gave in earlier runs; anything else counts as nothing.
    pub fn new(speeds: Speeds, kept: &[u8]) -> Self {
        Self { speeds, past: serde_json::from_slice(kept).unwrap_or_default(), now: BTreeMap::new() }
    }

    /// What so many units of a term will take.
    pub fn expected(&self, term: Term<'_>, units: f64) -> Expected {
        let name = term.name();
        let [past, now] = [&self.past, &self.now].map(|rates| rates.get(&name));
        let value = self.by_past(term, units) * now.and_then(Rate::median).unwrap_or(0.0).exp();
        let spread = past.map_or(ASSUMED_SPREAD, |past| past.spread(ASSUMED_SPREAD));
        let spread = now.map_or(spread, |now| now.spread(spread));
        Expected { value, error: value * spread.exp_m1() }
    }

    /// So many units of a term took that.
    pub fn learn(&mut self, term: Term<'_>, units: f64, measured: f64) {
        let log_ratio = (measured / self.by_past(term, units)).ln();
        self.now.entry(term.name()).or_default().learn(log_ratio);
    }

    /// What is to be kept: of this run after what is kept by now, which others may have added to.
    pub fn kept(&self, by_now: &[u8]) -> Vec<u8> {
        let mut past: BTreeMap<String, Rate> = serde_json::from_slice(by_now).unwrap_or_default();
        for (name, now) in &self.now {
            let before = self.past.get(name).and_then(Rate::median).unwrap_or(0.0);
            past.entry(name.clone()).or_default().learn(before + now.median().unwrap_or(0.0));
        }
        // names and lists of numbers
        serde_json::to_vec(&past).unwrap_or_default()
    }

    fn by_past(&self, term: Term<'_>, units: f64) -> f64 {
        let (each, least) = term.assumed(self.speeds);
        let past = self.past.get(&term.name()).and_then(Rate::median).unwrap_or(0.0);
        each * units.max(least) * past.exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRACE: Term<'_> = Term::Trace { is_deep: false };

    fn near(a: f64, b: f64) -> bool {
        (a / b - 1.0).abs() < 1e-12
    }

    #[test]
    fn what_was_measured_counts_in_this_run_and_in_the_next() {
        let mut first = Estimates::new(Speeds::Cpu(2), b"");
        // 2 ns a unit and thread are assumed, to within a factor of 2
        let assumed = first.expected(TRACE, 1e9);
        assert!(near(assumed.value, 1.0) && near(assumed.error, 1.0), "{assumed:?}");
        for measured in [3.0, 3.0, 100.0, 3.0] {
            first.learn(TRACE, 1e9, measured);
        }
        let learned = first.expected(TRACE, 2e9);
        // the one that was disturbed moves the value not at all, and the error: (ln 2 + ln(100/3)) / 5
        let spread = (200.0_f64 / 3.0).ln() / 5.0;
        assert!(near(learned.value, 6.0) && near(learned.error, 6.0 * spread.exp_m1()), "{learned:?}");
        // mirrors and glass, other formats and other terms are other rates
        assert!(near(first.expected(Term::Trace { is_deep: true }, 1e9).value, 4.0));
        let next = Estimates::new(Speeds::Cpu(2), &first.kept(b""));
        assert!(near(next.expected(TRACE, 2e9).value, 6.0));
        // one run is no certainty yet: (ln 2 + 0) / 2
        assert!(near(next.expected(TRACE, 1e9).error, 3.0 * (0.5_f64 * 2.0_f64.ln()).exp_m1()));
        assert_eq!(Estimates::new(Speeds::Gpu, b"{damaged"), Estimates::new(Speeds::Gpu, b""));
    }

    #[test]
    fn small_work_takes_what_the_least_takes() {
        let host = Estimates::new(Speeds::Host, b"");
        assert_eq!(host.expected(Term::Read, 10.0), host.expected(Term::Read, 0.0));
        assert!(host.expected(Term::Read, 10.0).value > 0.0);
    }

    #[test]
    fn small_pictures_say_what_large_ones_take_to_write() {
        let mut host = Estimates::new(Speeds::Host, b"");
        let (tiny, hd, uhd) = (64.0 * 36.0, 1280.0 * 720.0, 3840.0 * 2160.0);
        host.learn(Term::Write("png"), tiny, 5e-3);
        let host = Estimates::new(Speeds::Host, &host.kept(b""));
        let expected = |pixels| host.expected(Term::Write("png"), pixels).value;
        assert!(near(expected(tiny), 5e-3) && near(expected(hd), 5e-3), "{}", expected(hd));
        // 8.3 million pixels of which 4 million are the least
        assert!(near(expected(uhd), 5e-3 * uhd / 4e6));
    }

    #[test]
    fn errors_of_terms_add_as_squares() {
        let terms = [Expected { value: 1.0, error: 3.0 }, Expected { value: 2.0, error: 4.0 }];
        assert_eq!(terms.into_iter().sum::<Expected>(), Expected { value: 3.0, error: 5.0 });
    }
}
