//! Where the numbers that steer the method are declared: one `settings.rs` a stage, a struct for each file that reads them,
//! every number with its reason. `docs/settings.md` is the table of all of them.
//!
//! They are constants. With the feature `vary` they are read once instead, each times what the environment says, to
//! measure what a number does: `SGMDS_VARY="matching.search.search.basin=1.2"`.

/// Declares the settings of a stage: `NAME: Type { field: type = value, … }` for each file that reads some.
macro_rules! settings {
    ($(
        $(#[$about:meta])*
        $NAME:ident: $Type:ident { $($(#[$reason:meta])* $field:ident: $type:ty = $value:expr,)* }
    )*) => {$(
        $(#[$about])*
        #[derive(Debug, Clone)]
        pub struct $Type { $($(#[$reason])* pub $field: $type,)* }

        impl $Type {
            const DEFAULT: Self = Self { $($field: $value,)* };
        }

        impl Default for $Type {
            fn default() -> Self {
                $NAME.clone()
            }
        }

        $(#[$about])*
        #[cfg(not(feature = "vary"))]
        pub const $NAME: $Type = $Type::DEFAULT;

        $(#[$about])*
        #[cfg(feature = "vary")]
        pub static $NAME: std::sync::LazyLock<$Type> = std::sync::LazyLock::new(|| {
            let mut settings = $Type::DEFAULT;
            $($crate::settings::varied::vary(
                &mut settings.$field,
                concat!(module_path!(), "::", stringify!($NAME), "::", stringify!($field)),
            );)*
            settings
        });
    )*};
}

pub(crate) use settings;

/// Settings other than the default ones.
#[cfg(feature = "vary")]
pub(crate) mod varied {
    use std::ops::{Range, RangeInclusive};

    /// A setting that can be multiplied.
    pub(crate) trait Scale {
        fn scale(&mut self, by: f64);
    }

    impl Scale for f64 {
        fn scale(&mut self, by: f64) {
            *self *= by;
        }
    }

    impl Scale for f32 {
        fn scale(&mut self, by: f64) {
            *self = (f64::from(*self) * by) as f32;
        }
    }

    /// Whole numbers change by at least one.
    macro_rules! whole {
        ($($type:ty)*) => {$(
            // Not all of them are converted without loss.
            #[allow(clippy::cast_lossless)]
            impl Scale for $type {
                fn scale(&mut self, by: f64) {
                    let scaled = (*self as f64 * by).round() as $type;
                    *self = match by.total_cmp(&1.0) {
                        std::cmp::Ordering::Less => scaled.min(*self - 1),
                        std::cmp::Ordering::Equal => *self,
                        std::cmp::Ordering::Greater => scaled.max(*self + 1),
                    };
                }
            }
        )*};
    }
    whole!(usize u64 u8 i32);

    impl<T: Scale, const N: usize> Scale for [T; N] {
        fn scale(&mut self, by: f64) {
            for one in self {
                one.scale(by);
            }
        }
    }

    impl<A: Scale, B: Scale> Scale for (A, B) {
        fn scale(&mut self, by: f64) {
            self.0.scale(by);
            self.1.scale(by);
        }
    }

    impl<T: Scale> Scale for Range<T> {
        fn scale(&mut self, by: f64) {
            self.start.scale(by);
            self.end.scale(by);
        }
    }

    impl<T: Scale + Clone> Scale for RangeInclusive<T> {
        fn scale(&mut self, by: f64) {
            let (mut start, mut end) = (self.start().clone(), self.end().clone());
            start.scale(by);
            end.scale(by);
            *self = start..=end;
        }
    }

    /// Multiplies a setting by what the environment says for its path.
    pub(crate) fn vary(setting: &mut impl Scale, path: &str) {
        let name = path
            .trim_start_matches("sgmds_core::")
            .replace("::settings::", "::")
            .replace("::", ".")
            .to_lowercase();
        let asked = std::env::var("SGMDS_VARY").unwrap_or_default();
        let by = asked.split(',').find_map(|one| {
            let (asked, by) = one.split_once('=')?;
            (asked.trim() == name).then(|| by.trim().parse().expect("a factor after ="))
        });
        if let Some(by) = by {
            setting.scale(by);
        }
    }
}
