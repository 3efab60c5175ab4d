//! The solid and the solvers of a body, from the keys of its case file.

use std::sync::Arc;

use perimelt_core::family::LayerRule;
use perimelt_core::solver::Verlet;
use perimelt_core::world::BodyIndex;
use perimelt_core::{
    Body, Change, Correction, Face, Family, FamilySize, FamilySpec, Setup, SetupError, World, keys,
};

use super::energy::Energy;
use super::equilibrium::Statics;
use super::fields::{Features, Fields, LawState};
use super::fracture::{Criterion, Fracture};
use super::growth;
use super::keys::{Formulation, Kinematics, Mechanical};
use super::laminate::{PlyStrength, bonds_of_layers};
use super::law::{ChosenLaw, Parts};
use super::moduli::Elasticity;
use super::momentum::Balanced;
use super::plasticity::{ChosenFlow, Plasticity};
use super::section::Section;
use super::solid::{Constitution, PointStates, Solid};
use super::staggered;
use super::step::{MechanicalRun, MechanicalState};
use super::surface_stress::{Extrapolation, SurfaceStress};
use super::validity::{Validity, shear_warning};

/// Prepares the run of the body that `keys` name.
pub(super) fn run(
    keys: &mut Mechanical,
    setup: &mut Setup<'_>,
) -> Result<MechanicalRun, SetupError> {
    keys.check()?;
    // before the flow is taken, on which its default depends
    keys.formulation = Some(keys.formulation());
    let (plasticity, flow) = (keys.plasticity.take(), keys.flow.take());
    let flow = ChosenFlow::of(plasticity, flow, keys.annealing_temperature)?;
    let law = ChosenLaw::of(keys.law.take(), keys.formulation())?;
    let keys = &*keys;
    let body = setup.find_body(keys.body.as_deref())?;
    law.check_plies(setup.body(body))?;
    check_formulation(keys, setup, body)?;
    let layers = setup.layers(body, &keys::DISPLACEMENT);
    let family = family(keys, setup, body, layers.faces())?;
    check_held_layers(keys, setup, body, &layers.rules)?;
    let bent = traction_layer(keys, layers.rules)?;
    law.check(setup, body, flow.as_ref(), bent.as_ref())?;
    if let Some(rule) = bent {
        growth::check_layer(setup, body, rule.face)?;
    }
    Section::check_all(&keys.sections, setup, body)?;
    let extrapolation = extrapolation(keys, setup.body(body), &family)?;
    let elasticity = elasticity(keys, &law, setup, body)?;
    let constitution = constitution(keys, flow, setup, body, (&family, elasticity))?;
    let is_finite = constitution.finite;
    let damping = keys.solver.damping();
    let is_plastic = constitution.plasticity.is_some();
    let features = Features {
        is_explicit: damping.is_some(),
        flow: constitution.plasticity.as_ref().map(LawState::of_flow),
        has_points_as_nodes: true,
        law: None,
        breaks: constitution.fracture.is_some() || constitution.failure.is_some(),
        modes: &[],
    };
    let parts = Parts {
        body: setup.body(body),
        family,
        constitution,
        formulation: keys.formulation(),
        stabilisation: keys.stabilisation,
        name: law.name,
        constants: law.constants(setup.body(body))?,
    };
    let mut solid = law.law.solid(parts)?;
    load_present(&mut *solid, setup.world(), body);
    read_points_of_corners(&*solid, setup, body);
    let statics = Statics::new(&keys.solver, solid.base().tangent());
    let density = setup.world().density_at_points(body)?;
    let node_density = solid.base().nodes.densities(&density, &[]);
    let fields = declare(setup, body, features, &*solid)?;
    Ok(MechanicalRun {
        balanced: Balanced {
            dimension: setup.body(body).dimension,
            angular: is_finite,
        },
        body,
        layers: layers.handle,
        fields,
        work: vec![0.0; 3 * solid.base().nodes.count(setup.body(body))],
        loads: Vec::new(),
        held_corners: Default::default(),
        solid,
        free_inverse_density: (node_density.iter())
            .flat_map(|rho| [1.0 / rho; 3])
            .collect(),
        node_density,
        density,
        relative_volume: relative_volumes(setup, body),
        statics,
        eigenstrain_size: 0.0,
        scratch: Default::default(),
        section_forces: vec![[0.0; 3]; keys.sections.len()],
        broken_bonds: 0.0,
        logged_energy: damping.is_some().then(Energy::default),
        extrapolation,
        validity: Validity::new(setup.body(body), !is_finite, is_plastic),
        state: MechanicalState {
            verlet: Verlet::new(damping.unwrap_or(0.0)),
            ..MechanicalState::default()
        },
    })
}

/// Refuses what the formulation does not support, on a body that grows, or that processes share.
fn check_formulation(
    keys: &Mechanical,
    setup: &mut Setup<'_>,
    body: BodyIndex,
) -> Result<(), SetupError> {
    if keys.formulation() == Formulation::Staggered {
        staggered::check(keys)?;
    }
    growth::check(keys, setup, body)?;
    if keys.surface_stress != SurfaceStress::Extrapolated {
        return Ok(());
    }
    let message = "several processes do not extrapolate stress";
    let error = SetupError::value("surface_stress", message, "\"direct\", or one process");
    setup.refuse(body, Change::Division, error)
}

/// Declares the fields of a body with the law of its points and its modes of failure.
fn declare(
    setup: &mut Setup<'_>,
    body: BodyIndex,
    features: Features<'_>,
    solid: &dyn Solid,
) -> Result<Fields, SetupError> {
    let modes: Vec<&'static str> = solid.failure_modes().iter().map(|m| m.name).collect();
    let features = Features {
        has_points_as_nodes: solid.base().nodes.corners().is_none(),
        law: solid.base().law_points.as_ref().map(LawState::of_points),
        modes: &modes,
        ..features
    };
    Fields::declare(setup, body, features)
}

/// The elastic constants of the body, or of the isotropic solid that stands for its law.
fn elasticity(
    keys: &Mechanical,
    law: &ChosenLaw,
    setup: &mut Setup<'_>,
    body: BodyIndex,
) -> Result<Elasticity, SetupError> {
    if let Some(property) = law.law.youngs_modulus() {
        return Elasticity::alike(setup, body, keys.plane, property);
    }
    Elasticity::of(
        setup,
        body,
        keys.plane,
        keys.formulation() == Formulation::Bond,
    )
}

/// Refuses layers that hold a body in motion which processes share: the forces on them belong to the points that they follow.
fn check_held_layers(
    keys: &Mechanical,
    setup: &mut Setup<'_>,
    body: BodyIndex,
    rules: &[LayerRule],
) -> Result<(), SetupError> {
    let dimension = setup.body(body).dimension;
    let held = (rules.iter()).find(|rule| !rule.is_symmetric(dimension) && rule.traction.is_none());
    let (Some(rule), Some(_)) = (held, keys.solver.damping()) else {
        return Ok(());
    };
    // the corners of a staggered solid lie on the faces
    if keys.formulation() == Formulation::Staggered {
        return Ok(());
    }
    let message = format!(
        "forces on the layer behind face `{}`, which is held, belong to points of several processes",
        rule.face.name()
    );
    let expected = "`region` in place of `face` in `prescribed_displacement`, a solver of equilibrium, or one process";
    let error = SetupError::value("solver", message, expected);
    setup.refuse(body, Change::Division, error)
}

/// The rule of the layer by which a traction acts, if there is one.
fn traction_layer(
    keys: &Mechanical,
    rules: Vec<LayerRule>,
) -> Result<Option<LayerRule>, SetupError> {
    // the corners of a staggered solid lie on the faces
    let has_layers = keys.formulation() != Formulation::Staggered;
    let is_bent = |rule: &LayerRule| has_layers && rule.traction.is_some();
    let bent = rules.into_iter().find(is_bent);
    if let (Some(_), Some(rule)) = (keys.solver.damping(), &bent) {
        let message = format!(
            "the traction on face `{}` acts by a layer, whose forces have no energy: a body in motion would gain energy \
             without bound",
            rule.face.name()
        );
        let expected = "`by = \"body_force\"` in `traction`, or a solver of equilibrium: `quasi_static`, `relaxation`";
        return Err(SetupError::value("solver", message, expected));
    }
    Ok(bent)
}

/// The extrapolation of stress to the surface, if it is asked for.
fn extrapolation(
    keys: &Mechanical,
    body: &Body,
    family: &Family,
) -> Result<Option<Extrapolation>, SetupError> {
    match keys.surface_stress {
        SurfaceStress::Direct => Ok(None),
        SurfaceStress::Extrapolated if keys.fracture.is_some() => {
            let message = "stress is not extrapolated past cracks";
            let expected = "\"direct\" with `fracture`";
            Err(SetupError::value("surface_stress", message, expected))
        }
        SurfaceStress::Extrapolated => Ok(Some(Extrapolation::new(body, family)?)),
    }
}

/// Lets the values of points be exchanged whose corners a solid moves.
fn read_points_of_corners(solid: &dyn Solid, setup: &mut Setup<'_>, body: BodyIndex) {
    if let Some(corners) = solid.base().nodes.corners() {
        let known = corners.known_points().iter().enumerate();
        setup.read_points(body, known.filter(|(_, known)| **known).map(|(p, _)| p));
    }
}

/// Tells a solid whose nodes are corners which points have material.
fn load_present(solid: &mut dyn Solid, world: &World, body: BodyIndex) {
    let present = world.present_points(body);
    if let (Some(_), Some(present)) = (solid.base().nodes.corners(), present) {
        solid.set_points(PointStates {
            present: Some(&present),
            ..PointStates::default()
        });
    }
}

/// Volume over mean volume of each component, if points differ; else empty.
fn relative_volumes(setup: &Setup<'_>, body: BodyIndex) -> Vec<f64> {
    let volume = &setup.body(body).points.volume;
    if setup.body(body).lattice().is_some() {
        return Vec::new();
    }
    let reducer = setup.world().reducer(body);
    let [sum, count] = reducer.sum_points(|point| [volume[point], 1.0]);
    volume.iter().flat_map(|v| [v * count / sum; 3]).collect()
}

/// The bonds of the body.
fn family(
    keys: &Mechanical,
    setup: &mut Setup<'_>,
    body: BodyIndex,
    layers: Vec<Face>,
) -> Result<Arc<Family>, SetupError> {
    if keys.formulation() == Formulation::Staggered {
        // no bonds
        return Ok(Arc::new(Family::default()));
    }
    let correspondence = keys.formulation() == Formulation::Correspondence;
    let horizon = keys.horizon();
    horizon.check(setup.body(body))?;
    if !correspondence {
        let this = setup.body(body);
        let warning = shear_warning(this, &this.points.horizons(horizon));
        warning.into_iter().for_each(|warning| setup.warn(warning));
    }
    if keys.correction == Correction::Balanced {
        let message = "`balanced` puts linear temperatures in equilibrium, not deformations";
        return Err(SetupError::value("correction", message, "\"point\""));
    }
    let spec = FamilySpec {
        horizon,
        partial_volume: keys.partial_volume,
        influence: keys.influence,
        // correspondence is exact without a correction
        correction: match correspondence {
            true => Correction::Lattice,
            false => keys.correction,
        },
        layers,
        audited: Vec::new(),
    };
    let this = setup.body(body);
    if let Some(layers) = this.layers() {
        let plane = Family::build(layers.plane(), &spec);
        let plane = plane.map_err(|e| SetupError::new("horizon", e))?;
        let bonds = bonds_of_layers(layers.layers().len(), &plane);
        let size = FamilySize::of(body, &plane);
        setup.count_family(FamilySize { bonds, ..size });
        return Ok(Arc::new(plane));
    }
    if setup.world().is_growing(body) {
        return Ok(Arc::new(setup.own_family(body, &spec)?));
    }
    let family = setup.family(body, &spec)?;
    Ok(setup.world().family(family))
}

/// Elasticity, plasticity and strength of the body.
fn constitution(
    keys: &Mechanical,
    flow: Option<ChosenFlow>,
    setup: &mut Setup<'_>,
    body: BodyIndex,
    (family, elasticity): (&Family, Elasticity),
) -> Result<Constitution, SetupError> {
    let bond_based = keys.formulation() == Formulation::Bond;
    if let (true, Some(flow)) = (bond_based, &flow) {
        let message = "a bond-based solid has no plastic flow at constant volume";
        let expected = "`formulation` \"ordinary\", \"correspondence\" or \"staggered\", which is the default with plastic flow";
        return Err(SetupError::value(flow.key(), message, expected));
    }
    let criterion = keys.fracture.as_ref().map(|section| section.criterion);
    let by_energy = criterion == Some(Criterion::Energy);
    if by_energy && keys.formulation() == Formulation::Correspondence {
        let message = "a bond of a correspondence solid has no energy of its own";
        let expected = "\"stretch\", or `formulation` \"bond\" or \"ordinary\"";
        return Err(SetupError::value("fracture.criterion", message, expected));
    }
    let once = keys.fracture.as_ref().is_some_and(|section| section.once);
    if once && keys.solver.damping().is_some() {
        let message = "a solid in motion finds no equilibrium";
        let expected = "false, or `solver` \"quasi_static\" or \"relaxation\"";
        return Err(SetupError::value("fracture.once", message, expected));
    }
    let has_plies = setup.body(body).layers().is_some();
    Ok(Constitution {
        elasticity,
        finite: keys.kinematics == Kinematics::Finite,
        in_motion: keys.solver.damping().is_some(),
        symmetry: setup.world().symmetry(body),
        points: setup.world().reducer(body),
        plasticity: match flow {
            Some(flow) => Some(Plasticity::of(flow, setup.body(body), keys.plane)?),
            None => None,
        },
        fracture: match &keys.fracture {
            Some(section) if !has_plies => Some(Fracture::of(section, setup, body, family)?),
            _ => None,
        },
        failure: match &keys.fracture {
            Some(section) if has_plies => Some(PlyStrength::of(section, setup, body)?),
            _ => None,
        },
    })
}
