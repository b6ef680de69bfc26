//! The names, what each stands for, and the call that makes it.

use crate::sample::Sample;
use crate::{cad, general, geodesic, hostile, quad_sphere, scan, terrain, torus};

/// The most faces that may be asked for.
pub const MAX_FACES: usize = 50_000_000;

/// A sample mesh that can be generated.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Entry {
    /// What [`generate`] knows it by.
    pub name: &'static str,
    /// One line for people, without a final stop.
    pub about: &'static str,
    /// How many faces it has when none are asked for (about). 0: it has one size only.
    pub default_faces: usize,
    /// True if the seed changes the mesh or its texture.
    pub seeded: bool,
    /// True if it is broken, or at a scale or place where careless arithmetic breaks.
    pub hostile: bool,
    make: fn(usize, u64) -> Sample,
}

/// What to generate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct GenerateOptions {
    /// About how many faces; `None` for the entry's default. Met as closely as the shape's regular structure allows.
    pub faces: Option<usize>,
    /// Which of the many; 0 by default.
    pub seed: u64,
}

impl GenerateOptions {
    /// The same with about this many faces.
    pub fn with_faces(mut self, faces: usize) -> Self {
        self.faces = Some(faces);
        self
    }

    /// The same with this seed.
    pub fn with_seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }
}

/// Why nothing was generated.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum GenerateError {
    /// There is no sample of that name; take one of [`names`].
    UnknownName {
        /// The name asked for.
        name: String,
    },
    /// More than [`MAX_FACES`] faces were asked for.
    TooManyFaces {
        /// The number asked for.
        faces: usize,
    },
}

impl std::fmt::Display for GenerateError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            GenerateError::UnknownName { name } => {
                let known: Vec<&str> = ENTRIES.iter().map(|e| e.name).collect();
                write!(f, "no sample mesh is called {name:?}; there are {}", known.join(", "))
            }
            GenerateError::TooManyFaces { faces } => {
                write!(f, "{faces} faces asked for; at most {MAX_FACES} can be generated")
            }
        }
    }
}

impl std::error::Error for GenerateError {}

/// All sample meshes: the well-formed first, then the general, then the hostile.
pub fn names() -> &'static [Entry] {
    ENTRIES
}

/// Generates the sample mesh called `name`. O(faces).
pub fn generate(name: &str, options: &GenerateOptions) -> Result<Sample, GenerateError> {
    let entry = ENTRIES
        .iter()
        .find(|e| e.name == name)
        .ok_or_else(|| GenerateError::UnknownName { name: name.to_string() })?;
    let faces = options.faces.unwrap_or(entry.default_faces);
    if faces > MAX_FACES {
        return Err(GenerateError::TooManyFaces { faces });
    }
    Ok((entry.make)(faces, options.seed))
}

const fn well(name: &'static str, about: &'static str, faces: usize, seeded: bool, make: Make) -> Entry {
    Entry { name, about, default_faces: faces, seeded, hostile: false, make }
}

const fn bad(name: &'static str, about: &'static str, make: Make) -> Entry {
    Entry { name, about, default_faces: scan::DEFAULT_FACES, seeded: true, hostile: true, make }
}

type Make = fn(usize, u64) -> Sample;

const ENTRIES: &[Entry] = &[
    well("sphere", "geodesic unit sphere of triangles", 20_480, false, |n, _| geodesic::sphere(n)),
    well(
        "quad-sphere",
        "unit sphere of quads with normals, uv seams and a texture",
        6_144,
        true,
        quad_sphere::quad_sphere,
    ),
    well("torus", "torus of triangles with normals, radii 1 and 0.4", 16_384, false, |n, _| torus::torus(n)),
    well(
        "terrain",
        "square patch of fractal heights with an open border and uvs",
        32_768,
        true,
        terrain::terrain,
    ),
    well("scan", "noisy scan-like blob with ragged holes, diagonal 1", scan::DEFAULT_FACES, true, scan::scan),
    well(
        "cad",
        "block with a bore: exact planes tessellated needlessly, sharp edges",
        12_000,
        true,
        cad::cad,
    ),
    well(
        "nonmanifold",
        "three fins on an edge, two cones at a vertex, a wire, an isolated vertex",
        128,
        false,
        |n, _| general::nonmanifold(n),
    ),
    well(
        "polygons",
        "sheet of triangles, quads and larger polygons, convex and concave",
        2_000,
        true,
        general::polygons,
    ),
    bad("offset-1e4", "the scan moved by 10,000, rounded to f32", |n, s| hostile::offset(n, s, 1e4, true)),
    bad("offset-1e6", "the scan moved by 1,000,000, rounded to f32 (16 steps across)", |n, s| {
        hostile::offset(n, s, 1e6, true)
    }),
    bad("offset-1e4-f64", "the scan moved by 10,000, in f64", |n, s| hostile::offset(n, s, 1e4, false)),
    bad("offset-1e6-f64", "the scan moved by 1,000,000, in f64", |n, s| hostile::offset(n, s, 1e6, false)),
    bad("scale-1e-12", "the scan times 1e-12", |n, s| hostile::scale(n, s, [1e-12; 3])),
    bad("scale-1e12", "the scan times 1e12", |n, s| hostile::scale(n, s, [1e12; 3])),
    bad("scale-1e-25", "the scan times 1e-25: squares underflow f32", |n, s| {
        hostile::scale(n, s, [1e-25; 3])
    }),
    bad("squashed", "the scan with z times 1e-6", |n, s| hostile::scale(n, s, [1.0, 1.0, 1e-6])),
    bad("nan", "the scan with one coordinate NaN", |n, s| hostile::set_one(n, s, f64::NAN)),
    bad("inf", "the scan with one coordinate infinite", |n, s| hostile::set_one(n, s, f64::INFINITY)),
    bad(
        "degenerate-faces",
        "the scan with faces of zero area and faces that repeat a vertex",
        hostile::degenerate_faces,
    ),
    bad(
        "duplicate-faces",
        "the scan with faces that are there twice, rotated and reversed too",
        hostile::duplicate_faces,
    ),
    bad(
        "index-out-of-range",
        "the scan with one index equal to the number of vertices",
        hostile::index_out_of_range,
    ),
    bad("soup", "the scan with three vertices of its own for every face", hostile::soup),
    bad("flipped-half", "the scan with half of the faces turned over", hostile::flipped_half),
    Entry {
        seeded: false,
        default_faces: 0,
        ..bad("empty", "no vertex and no face", |_, _| Sample::default())
    },
    Entry {
        seeded: false,
        default_faces: 0,
        ..bad("single-triangle", "one triangle", |_, _| hostile::single_triangle())
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_name_is_answered_with_the_known_ones() {
        let e = generate("teapot", &GenerateOptions::default()).unwrap_err();
        assert!(e.to_string().contains("\"teapot\"") && e.to_string().contains("quad-sphere"));
    }

    #[test]
    fn too_many_faces_are_refused() {
        let e = generate("sphere", &GenerateOptions::default().with_faces(MAX_FACES + 1));
        assert_eq!(e, Err(GenerateError::TooManyFaces { faces: MAX_FACES + 1 }));
    }

    #[test]
    fn names_are_unique_and_described() {
        for (i, e) in names().iter().enumerate() {
            assert!(!e.about.is_empty() && !e.about.ends_with('.'), "{}", e.name);
            assert!(names()[..i].iter().all(|o| o.name != e.name), "{} twice", e.name);
        }
    }
}
