//! Functions that are compiled twice: for the vector unit that every machine has, and for the wider one that most have, chosen
//! when they run.
//!
//! Both give the same bytes: the compiler neither reorders nor fuses what is written here, it only does more of it at a time.

/// Makes two of a function; what it calls takes part as far as it is `#[inline(always)]`.
macro_rules! vectorised {
    ($(#[$attribute:meta])* $visibility:vis fn $name:ident($($argument:ident: $type:ty),* $(,)?) $(-> $result:ty)? $body:block) => {
        $(#[$attribute])*
        $visibility fn $name($($argument: $type),*) $(-> $result)? {
            #[inline(always)]
            fn anywhere($($argument: $type),*) $(-> $result)? $body

            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2")]
            fn avx2($($argument: $type),*) $(-> $result)? {
                anywhere($($argument),*)
            }

            #[cfg(target_arch = "x86_64")]
            if $crate::vectorised::avx2() {
                #[expect(unsafe_code, reason = "the one way to call a function for a vector unit that not every machine has")]
                // SAFETY: this machine has it.
                return unsafe { avx2($($argument),*) };
            }
            anywhere($($argument),*)
        }
    };
}
pub(crate) use vectorised;

/// Whether this machine has AVX2.
#[cfg(target_arch = "x86_64")]
#[inline]
pub(crate) fn avx2() -> bool {
    #[cfg(test)]
    if tests::NARROW.get() {
        return false;
    }
    std::arch::is_x86_feature_detected!("avx2")
}

#[cfg(test)]
mod tests {
    use crate::parameters::{Method, Parameters};
    use crate::state::{Frame, State};
    use crate::transform::Class;
    use messages::{FrameLayout, PixelFormat};
    use std::cell::Cell;

    thread_local! {
        /// Makes this thread do without the wider vector unit.
        pub(super) static NARROW: Cell<bool> = const { Cell::new(false) };
    }

    /// The states after each of some frames of a camera that pans over a wall while a dark square walks by.
    fn states(width: usize, height: usize, parameters: &Parameters, narrow: bool) -> Vec<Vec<u8>> {
        NARROW.set(narrow);
        let mut state = State::new(parameters.clone());
        let layout = FrameLayout { width: width as u32, height: height as u32, stride: width as u32, format: PixelFormat::Grey as u32 };
        let frame = |n: usize| -> Vec<u8> {
            let wave = |x: f64, y: f64| 40.0 * (0.31 * x + 0.11 * y).sin() + 30.0 * (0.23 * y - 0.07 * x).cos();
            let pixel = |at: usize| {
                let (u, v) = (at % width, at / width);
                let figure = (3 * n..3 * n + width / 6).contains(&u) && (height / 4..height * 3 / 4).contains(&v);
                let shift = 0.7 * n.saturating_sub(6) as f64;
                let z = if figure { 40.0 } else { 128.0 + wave(u as f64 * (1.0 + 0.002 * shift) + shift, v as f64) };
                (z + (at * 31 + n * 17) as f64 % 5.0) as u8
            };
            (0..width * height).map(pixel).collect()
        };
        (0..16)
            .map(|n| {
                state.step(&Frame { stamp_ns: (n as u64 + 1) * 66_666_667, layout, bytes: &frame(n), odometry: None });
                state.save()
            })
            .collect()
    }

    #[test]
    fn every_vector_unit_gives_the_same_bytes() {
        for class in [Class::Translation, Class::Similarity, Class::Affine, Class::Homography] {
            for (width, height, method) in
                [(160, 120, Method::Direct), (93, 67, Method::Direct), (330, 241, Method::Direct), (100, 60, Method::Icp)]
            {
                let parameters = Parameters { class, method, training_frames: 4, ..Parameters::default() };
                let (narrow, wide) = (states(width, height, &parameters, true), states(width, height, &parameters, false));
                for (n, (narrow, wide)) in narrow.iter().zip(&wide).enumerate() {
                    assert!(narrow == wide, "{width} × {height}, {class:?}, {method:?}: frame {n}");
                }
            }
        }
    }
}
