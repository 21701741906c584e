use std::ops::ControlFlow;

use thetahat_numerics::optimize::Stopped;

use super::*;
use crate::estimate::subspace::tests::{Run, distance, plant};
use crate::estimate::{SubspaceOptions, Weighting, subspace};

/// A record of the plant in two segments, a start from a subspace method with levels that are off, and what is looked
/// for.
fn start(record: &JointRecord<'_>, weighting: Weighting) -> Result<RefinementStart, Error> {
    let options = SubspaceOptions { weighting, feedthrough: Some(true), ..SubspaceOptions::default() };
    let model = subspace(record, &options)?.state_space(4, 1.0)?;
    Ok(RefinementStart { name: weighting.to_string(), model, levels: vec![0.1, -0.2] })
}

fn what(refine: Refine) -> Refinement {
    Refinement { refine, feedthrough: true, constant: true, degrees_of_freedom: 950 }
}

#[test]
fn the_normal_equations_have_the_gradient_of_the_cost() -> Result<(), Error> {
    let run = Run::open(&plant(), 300, 1, 1.0);
    let mut record = run.record();
    record.segments = vec![3..100, 110..300];
    let start = start(&record, Weighting::Ssarx)?;
    for refine in Refine::ALL {
        let what = what(refine);
        let units = Units::of(&record, &start, what)?.expect("a stable start");
        let scaled = units.record(&record, &start.levels);
        let scaled = JointRecord {
            inputs: scaled.inputs.iter().map(Vec::as_slice).collect(),
            outputs: scaled.outputs.iter().map(Vec::as_slice).collect(),
            segments: record.segments.clone(),
        };
        let mut form = Form::of(&units.to_units(&start.model), refine);
        let sizes = form.state_sizes(&scaled, refine).ok_or_else(no_errors)?;
        form.divide_states(&sizes);
        let basis = directions(&form, what).ok_or_else(no_errors)?;
        let mut errors = Errors::new(&scaled, refine, form, basis, units.floor.clone());
        // n (m + 2 l) + l m + l, or without K.
        let size = errors.directions();
        assert_eq!(size, if refine == Refine::Prediction { 24 + 4 + 2 } else { 16 + 4 + 2 });
        let mut cost = |direction: usize, by: f64| {
            let mut parameters = vec![0.0; size];
            parameters[direction] = by;
            errors.evaluate(&parameters).map_err(|_| no_errors())
        };
        let step = 1e-6;
        let slopes = (0..size)
            .map(|direction| Ok((cost(direction, step)? - cost(direction, -step)?) / (2.0 * step)))
            .collect::<Result<Vec<f64>, Error>>()?;
        cost(0, 0.0)?;
        errors.linearize().map_err(|_| no_errors())?;
        let largest = slopes.iter().fold(0.0_f64, |largest, slope| largest.max(slope.abs()));
        for (slope, right) in slopes.iter().zip(errors.right()) {
            // The states that segments start from are the best for errors of covariance I, and these have nearly that.
            assert!((slope + 2.0 * right).abs() < 3e-4 * largest, "{refine}: {slope} {}", -2.0 * right);
        }
    }
    Ok(())
}

#[test]
fn the_least_errors_do_not_depend_on_the_start_and_lie_near_the_plant() -> Result<(), Error> {
    let truth = plant();
    let run = Run::open(&truth, 1000, 2, 1.0);
    let record = run.record();
    let starts = [start(&record, Weighting::Ssarx)?, start(&record, Weighting::Moesp)?];
    for refine in Refine::ALL {
        let find = |starts: &[RefinementStart]| {
            refined(&record, starts, what(refine), &Search::default(), &|_| ControlFlow::Continue(()))
        };
        let (first, second) = (find(&starts[..1])?, find(&starts[1..])?);
        assert_eq!((first.search.stopped, second.search.stopped), (Stopped::Converged, Stopped::Converged));
        let (apart, off) = (distance(&first.model, &second.model), distance(&first.model, &truth));
        assert!(apart < 2e-3, "{refine}: {apart}");
        assert!(off < 0.1, "{refine}: {off}");
        assert!(first.levels.iter().all(|level| level.abs() < 0.2), "{refine}: {:?}", first.levels);
        let covariance = first.covariance.ok_or_else(no_errors)?;
        assert_eq!(covariance.entries.len(), 28);
        let both = find(&starts)?;
        assert_eq!(both.search.starts.len(), 2);
    }
    Ok(())
}
