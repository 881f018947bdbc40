//! Keys over time: STEP, LINEAR and CUBICSPLINE (glTF 2.0, appendix C).

use gltf::json::animation::Interpolation;

/// The keys of one channel.
#[derive(Clone, Debug)]
pub(super) struct Track {
    /// Times, seconds, ascending, at least one.
    pub times_s: Vec<f64>,
    /// For each key `width` numbers; CUBICSPLINE: the tangent coming in, the value, the tangent going out.
    pub values: Vec<f64>,
    /// Numbers of a value.
    pub width: usize,
    /// What is between keys.
    pub interpolation: Interpolation,
    /// Whether values are unit quaternions, x y z w.
    pub is_rotation: bool,
}

impl Track {
    /// The value at a time; before the first key that of the first, after the last that of the last.
    pub(super) fn at(&self, time_s: f64) -> Vec<f64> {
        let last = self.times_s.len() - 1;
        let after = self.times_s.partition_point(|&t| t <= time_s);
        let mut value = if after == 0 {
            self.value(0).to_vec()
        } else if after > last {
            self.value(last).to_vec()
        } else {
            self.between(after - 1, time_s)
        };
        if self.is_rotation {
            normalize(&mut value);
        }
        value
    }

    fn between(&self, key: usize, time_s: f64) -> Vec<f64> {
        let (from, to) = (self.value(key), self.value(key + 1));
        let length_s = self.times_s[key + 1] - self.times_s[key];
        let s = (time_s - self.times_s[key]) / length_s;
        match self.interpolation {
            Interpolation::Step => from.to_vec(),
            Interpolation::Linear if self.is_rotation => slerp(from, to, s),
            Interpolation::Linear => from.iter().zip(to).map(|(a, b)| a + (b - a) * s).collect(),
            Interpolation::CubicSpline => {
                let (leaving, arriving) = (self.part(key, 2), self.part(key + 1, 0));
                let (s2, s3) = (s * s, s * s * s);
                (0..self.width)
                    .map(|i| {
                        (2.0 * s3 - 3.0 * s2 + 1.0) * from[i]
                            + length_s * (s3 - 2.0 * s2 + s) * leaving[i]
                            + (3.0 * s2 - 2.0 * s3) * to[i]
                            + length_s * (s3 - s2) * arriving[i]
                    })
                    .collect()
            }
        }
    }

    fn value(&self, key: usize) -> &[f64] {
        self.part(key, usize::from(self.interpolation == Interpolation::CubicSpline))
    }

    fn part(&self, key: usize, part: usize) -> &[f64] {
        let parts = if self.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let first = (key * parts + part) * self.width;
        &self.values[first..first + self.width]
    }
}

/// The way along the shorter arc; quaternions x y z w, which need not be unit to the last bit.
fn slerp(a: &[f64], b: &[f64], s: f64) -> Vec<f64> {
    let (mut a, mut b) = (a.to_vec(), b.to_vec());
    normalize(&mut a);
    normalize(&mut b);
    let dot: f64 = a.iter().zip(&b).map(|(a, b)| a * b).sum();
    if dot < 0.0 {
        b = b.into_iter().map(|x| -x).collect();
    }
    // the angle by its tangent: exact for small ones too
    let length =
        |f: &dyn Fn(f64, f64) -> f64| a.iter().zip(&b).map(|(&a, &b)| f(a, b) * f(a, b)).sum::<f64>().sqrt();
    let angle = 2.0 * libm::atan2(length(&|a, b| a - b), length(&|a, b| a + b));
    let sine = libm::sin(angle);
    let (of_a, of_b) = if sine < 1e-9 {
        (1.0 - s, s)
    } else {
        (libm::sin((1.0 - s) * angle) / sine, libm::sin(s * angle) / sine)
    };
    a.iter().zip(&b).map(|(a, b)| of_a * a + of_b * b).collect()
}

/// Makes a quaternion unit; one without length is no rotation.
fn normalize(q: &mut [f64]) {
    let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length > 0.0 && length.is_finite() {
        for x in q {
            *x /= length;
        }
    } else if let [x, y, z, w] = q {
        (*x, *y, *z, *w) = (0.0, 0.0, 0.0, 1.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(interpolation: Interpolation, width: usize, values: &[f64]) -> Track {
        Track {
            times_s: vec![1.0, 3.0],
            values: values.to_vec(),
            width,
            interpolation,
            is_rotation: width == 4,
        }
    }

    fn near(got: &[f64], wanted: &[f64]) {
        assert!(got.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-12), "{got:?}, not {wanted:?}");
    }

    #[test]
    fn steps_and_lines() {
        let step = track(Interpolation::Step, 1, &[5.0, 7.0]);
        assert_eq!([0.0, 1.0, 2.9, 3.0, 9.0].map(|t| step.at(t)[0]), [5.0, 5.0, 5.0, 7.0, 7.0]);
        let line = track(Interpolation::Linear, 2, &[5.0, 0.0, 7.0, 1.0]);
        near(&line.at(1.5), &[5.5, 0.25]);
        near(&line.at(4.0), &[7.0, 1.0]);
        assert_eq!(line.at(f64::NAN).len(), 2);
    }

    #[test]
    fn rotations_take_the_shorter_arc() {
        // from none to 90° about z: a quarter of the way is 22.5°, its half 11.25°; −q is the same rotation
        let half = 45f64.to_radians();
        for sign in [1.0, -1.0] {
            let turn = track(
                Interpolation::Linear,
                4,
                &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, sign * half.sin(), sign * half.cos()],
            );
            let quarter = 11.25f64.to_radians();
            near(&turn.at(1.5), &[0.0, 0.0, quarter.sin(), quarter.cos()]);
        }
        // nearly the same: the chord and the arc are one, to the square of the angle
        let tiny = 1e-10;
        let still = track(Interpolation::Linear, 4, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, tiny, 1.0]);
        near(&still.at(2.0), &[0.0, 0.0, 0.5e-10, 1.0]);
        let none = track(Interpolation::Linear, 4, &[0.0; 8]);
        assert_eq!(none.at(2.0), [0.0, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn splines_by_hand() {
        // values 1 and 2, leaving with slope 1/s, arriving with −1/s, two seconds apart, at a quarter:
        // s = 1/4, s² = 1/16, s³ = 1/64
        // (2/64 − 3/16 + 1)·1 = 0.84375; 2·(1/64 − 2/16 + 1/4)·1 = 0.28125
        // (3/16 − 2/64)·2 = 0.3125; 2·(1/64 − 1/16)·(−1) = 0.09375
        let spline = track(Interpolation::CubicSpline, 1, &[9.0, 1.0, 1.0, -1.0, 2.0, 9.0]);
        near(&spline.at(1.5), &[0.84375 + 0.28125 + 0.3125 + 0.09375]);
        assert_eq!((spline.at(0.0)[0], spline.at(3.0)[0]), (1.0, 2.0));
    }
}
