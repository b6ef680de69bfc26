//! Typed ids: a `u32` index that says which array it indexes.

macro_rules! id {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(transparent)]
        pub struct $name(pub u32);

        impl $name {
            /// The id as an array index.
            #[inline]
            pub const fn index(self) -> usize {
                self.0 as usize
            }
        }

        impl From<u32> for $name {
            #[inline]
            fn from(i: u32) -> Self {
                Self(i)
            }
        }

        impl std::fmt::Debug for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                write!(f, "{}{}", &stringify!($name)[..1].to_ascii_lowercase(), self.0)
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                write!(f, "{}", self.0)
            }
        }
    };
}

id!(
    /// A vertex.
    VertexId
);
id!(
    /// An edge.
    EdgeId
);
id!(
    /// A face.
    FaceId
);
id!(
    /// A wedge: one set of attribute values shared by corners of a vertex.
    WedgeId
);

/// "No such element" where an optional id is stored flat.
pub const NONE: u32 = u32::MAX;
