//! Numbers of the things in a list, those of each list of a type of their own.

/// A place in a list.
pub trait Number: Copy {
    /// The place as an index.
    fn index(self) -> usize;
}

/// Of whatever list is at hand.
impl Number for u32 {
    #[inline(always)]
    fn index(self) -> usize {
        self as usize
    }
}

/// Defines numbers of the given names, none of which can be taken for one of another list.
macro_rules! numbering {
    ($($(#[$about:meta])* $Name:ident;)+) => {$(
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
        pub struct $Name(pub u32);

        impl $Name {
            /// Its place in the list.
            #[must_use]
            #[inline(always)]
            pub fn index(self) -> usize {
                self.0 as usize
            }

            /// These places of the list, without a copy.
            #[must_use]
            pub fn each(places: Vec<u32>) -> Vec<Self> {
                places.into_iter().map(Self).collect()
            }
        }

        impl $crate::algebra::numbering::Number for $Name {
            #[inline(always)]
            fn index(self) -> usize {
                self.0 as usize
            }
        }
    )+};
}

pub(crate) use numbering;
