//! Numbers that steer this stage, each with its reason.

use std::ops::{Range, RangeInclusive};

use crate::settings::settings;

settings! {
    /// Surfaces that lie on one another as they were given: two meshes of one thing, or a piece and its whole.
    COINCIDENCE: Coincidence {
        /// Surfaces coincide when all but `stray` of their vertices lie this near to the tangent plane at their
        /// image: the nearest point is then as good an image as a map that is right to so much.
        coincident: f64 = 0.015,
        /// Share of the vertices that may lie farther away.
        stray: f64 = 0.03,
        /// Nor may an image lie farther away along that plane than this: some edges of a coarse mesh.
        beside: f64 = 0.1,
        /// Vertices asked first, without a tree, which is made only where these do not tell that too many lie
        /// elsewhere.
        first_asked: usize = 100,
    }

    /// Embeddings of both shapes in a step, and the images found in them.
    EMBEDDING: Embedding {
        /// Sweeps of the nearest neighbours at each step.
        sweeps: usize = 3,
    }

    /// Least squares of each step: the displacement and the map, from the present images.
    FITS: Fits {
        /// Ridge of the displacement fit, relative to Λ/λ₂₀.
        displacement_ridge: f64 = 2e-4,
        /// Ridge of the map fit.
        map_ridge: f64 = 1e-3,
        /// Eigenvalue that sets the scale of the displacement's smoothness.
        smoothness_pair: usize = 20,
    }

    /// The surface slides along the other, deformed by maps that are affine on each part.
    POINT_TO_PLANE: PointToPlane {
        /// By how much more than before a surface that slid may stretch edges: where parts bend too sharply for it
        /// and maps become worse it is 1.26 to 1.32 times as much, elsewhere 0.75 to 1.15 times.
        most_stretched: f64 = 1.2,
        /// Rounds of sliding at most. With four, fingers of `MakeHuman` bodies more often land beside their own.
        slides: usize = 5,
        /// Last of them, in which images are points of triangles, in those before the vertices nearest to them: in
        /// all rounds by vertices, errors are two per cent larger.
        slides_within_triangles: usize = 2,
        /// How far beyond where it is drawn a surface goes on in all rounds between the first and the last, relative
        /// to the way there: without it the same errors take eight rounds, with half and three quarters of it six.
        beyond: f64 = 0.8,
        /// Share of the images that change in a round below which they have slid.
        slid: f64 = 0.03,
        /// Steps with the whole surface where it slid to, in other poses: without them errors are a twentieth larger,
        /// and rise where nothing has to slide.
        steps_after_sliding: usize = 2,
    }

    /// Steps on the whole surface: drawn onto the other as rigidly as possible, or moved onto it where both coincide.
    RIGID_STEPS: RigidSteps {
        /// Root mean square distance between matched points of surfaces that are moved onto each other, above which
        /// they are in other poses: maps are right to 0.02. After an affine map bodies of different build in one pose
        /// leave 0.02 to 0.045, other poses 0.06 and more.
        same_pose: f64 = 0.05,
        /// Times that coinciding surfaces are moved onto each other.
        moves: usize = 6,
        /// Share of the images that change in a step on the whole surface below which it has come to rest.
        at_rest: f64 = 0.015,
    }

    /// Fingers that a map laid onto their neighbours.
    FINGERS: Fingers {
        /// What it costs to lay a protrusion on none while there is another.
        nowhere: f64 = 0.02,
        /// How far around a tip others are of its group, √area: a hand.
        group: f32 = 0.3,
        /// How far from the image of a tip the other surface's are of the group there.
        there: f32 = 0.15,
        /// Protrusions of a group; all ways of laying so many onto one another are tried.
        sizes: RangeInclusive<usize> = 2..=6,
        /// Share of a protrusion that has to lie on another to be there.
        most: f64 = 0.5,
        /// What a group may be larger or smaller, in proportion.
        scales: (f64, f64) = (0.7, 1.4),
        /// What it costs to lie somewhere else than now, beside changes of distances, for each unit of length; so
        /// that no hand is turned upside down.
        moved: f64 = 0.25,
    }

    /// What a part covers of the whole, as a surface of its own.
    OVERLAP: Overlap {
        /// How far around the images of its vertices a part covers the whole, in mean distances between vertices: as
        /// far as its area asks for, within this range. Farther off, a limb is missing that the map lays onto
        /// another.
        reach: RangeInclusive<f32> = 1.0..=2.5,
        /// Share of the covered faces that have to hang together.
        in_one_piece: f64 = 0.97,
        /// By how much the reach is widened where a narrow bridge is missing.
        wider: f32 = 1.4,
        /// How often it is widened.
        widenings: i32 = 4,
        /// A part that covers more of the whole than this leaves nothing to be cut away.
        nearly_all: f64 = 0.98,
    }

    /// What draws one body onto another, along which it slides.
    PARTS: Parts {
        /// Weight of the first images beside the tangent planes, along which nothing else would hold what slides:
        /// half as much gives the same, five times as much holds back what should slide.
        anchor: f64 = 1e-3,
        /// How deep within the other body a vertex draws a quarter; half and twice as much change errors by up to 6
        /// %.
        swallowed: f64 = 5e-3,
    }

    /// Two refined maps of one pair, region by region.
    REGIONS: Regions {
        /// Images of a vertex that are farther apart than this are different, √area: maps are right to 0.015.
        apart: f64 = 0.013,
        /// Regions of less area say nothing: some ten vertices of a mesh of 5,000.
        least_region: f64 = 0.002,
    }

    /// How long the unit of one shape is on the other, of which it may be a part.
    RELATIVE_LENGTH: RelativeLength {
        /// Samples between which distances are compared.
        samples: usize = 200,
        /// Distances that are compared, √area: shorter ones are imprecise, longer ones lead around what was cut away.
        compared: Range<f64> = 0.1..0.4,
        /// Shapes of more than this fraction of each other's lengths are taken for equal: characters of other build
        /// come to 0.98.
        equal_from: f64 = 0.95,
    }

    /// One shape's part in a refinement: which vertices ask and where their images lie, the embedding of the surface,
    /// and weighted rows for the fits.
    SIDE: Side {
        /// Vertices of a whole shape that fits are made of: with those of the other some 17 equations for each of 150
        /// eigenfunctions. With more, or with all, no error is smaller; with 1,024 those of animals are 1 % larger.
        fitting: usize = 1_280,
    }

    /// Spectral upsampling: more eigenfunctions at each step, fitted in both directions.
    UPSAMPLING: Upsampling {
        /// Eigenfunctions of an upsampled map.
        upsampled_size: usize = 60,
        /// Eigenfunctions added a step; with four errors are the same.
        step: usize = 6,
    }
}
