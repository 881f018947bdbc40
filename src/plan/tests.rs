//! What is kept, what is given up, and for whom.

use super::*;
use crate::scene::{Faces, MaterialRuns, Object, Part, Positions, Triangles};
use std::sync::Arc;

/// A strip of so many triangles at a height.
fn strip(triangles: u32, height: f32) -> Object {
    let corners: Vec<[u32; 3]> = (0..triangles).map(|i| [i, i + 1, i + 2]).collect();
    let geometry = Geometry {
        positions: Part::new(Positions(
            (0..triangles + 2).map(|i| [i as f32, (i % 2) as f32, height]).collect(),
        )),
        faces: Part::new(Faces { counts: vec![3; corners.len()], corners: corners.concat() }),
        triangles: Part::new(Triangles(corners)),
        texcoords: None,
        normals: None,
        colors: None,
        material_runs: Part::new(MaterialRuns(Vec::new())),
        materials: Vec::new(),
        meshes: Vec::new(),
    };
    Object { geometry: Arc::new(geometry), transform: None }
}

/// Does to a residency what a device does, and gives the steps' words.
fn apply(residency: &mut Residency, objects: Vec<Object>, wishes: &Wishes) -> Vec<&'static str> {
    let frame = Frame { objects };
    let plan = plan_frame(&frame, residency, wishes);
    residency.begin(&plan);
    let mut words = Vec::new();
    for step in &plan.steps {
        words.push(match *step {
            Step::Free { name } => {
                residency.free(name);
                "free"
            }
            Step::Evict { name } => {
                residency.evict(name);
                "evict"
            }
            Step::Keep { name } => {
                residency.keep(name);
                "keep"
            }
            Step::Upload { part, bytes } => {
                residency.hold(part, bytes);
                "upload"
            }
            Step::Refit { from, tree, object, .. } => {
                residency.refit(from, tree, &frame.objects[object].geometry, 1.0);
                "refit"
            }
            Step::Build { tree, object, triangles } => {
                let state = TreeState::built(&frame.objects[object].geometry, 1.0);
                residency.hold_tree(tree, triangles * TREE_BYTES_PER_TRIANGLE, state);
                "build"
            }
        });
    }
    residency.end(&plan);
    assert_eq!(residency.bytes(), residency.held.values().map(|held| held.bytes).sum::<u64>());
    words
}

fn holds(residency: &Residency, object: &Object) -> bool {
    residency.held.contains_key(&tree_name(&object.geometry))
}

/// The first object comes again.
fn again(budget_bytes: u64) -> Wishes {
    Wishes { used_again: vec![0], budget_bytes, ..Wishes::default() }
}

#[test]
fn what_comes_again_is_kept_and_the_rest_is_freed() {
    let (a, b, c) = (strip(10, 0.0), strip(20, 0.0), strip(30, 0.0));
    let mut residency = Residency::default();
    apply(&mut residency, vec![a.clone()], &again(u64::MAX));
    apply(&mut residency, vec![b.clone()], &Wishes::default());
    assert!(holds(&residency, &a) && holds(&residency, &b));
    apply(&mut residency, vec![c.clone()], &Wishes::default());
    assert!(holds(&residency, &a) && !holds(&residency, &b));
    let words = apply(&mut residency, vec![a.clone()], &Wishes::default());
    assert!(!words.contains(&"upload") && !words.contains(&"build"), "{words:?}");
    apply(&mut residency, vec![c], &Wishes::default());
    assert!(!holds(&residency, &a), "it does not come again");
    assert_eq!(residency.evictions, 0);
}

#[test]
fn for_want_of_space_the_least_recently_used_goes_first() {
    let strips: Vec<Object> = [10, 11, 12].map(|n| strip(n, 0.0)).to_vec();
    let bytes = |residency: &mut Residency| {
        apply(residency, strips.clone(), &again(u64::MAX));
        residency.bytes()
    };
    // one byte less than all three need
    let budget = bytes(&mut Residency::default()) - 1;
    let mut residency = Residency::default();
    for i in [0, 1, 0, 2] {
        apply(&mut residency, vec![strips[i].clone()], &again(budget));
        assert!(residency.bytes() <= budget);
    }
    assert!(residency.evictions > 0);
    assert!(holds(&residency, &strips[0]) && holds(&residency, &strips[2]));
    let all_of_1 = strips[1].geometry.parts().iter().all(|(name, _)| residency.held.contains_key(name));
    assert!(!(holds(&residency, &strips[1]) && all_of_1), "it was used before the others");
}

#[test]
fn what_is_overwritten_is_not_kept_though_it_comes_again() {
    let mut residency = Residency::default();
    let mut held = Vec::new();
    for frame in 0..10 {
        apply(&mut residency, vec![strip(40, frame as f32)], &again(u64::MAX));
        held.push(residency.bytes());
    }
    assert!(held.iter().all(|bytes| *bytes == held[0]), "{held:?}");
}

#[test]
fn of_trees_over_the_same_faces_the_one_used_last_is_refitted() {
    let mut residency = Residency::default();
    let (old, new) = (strip(40, 1.0), strip(40, 2.0));
    apply(
        &mut residency,
        vec![old.clone(), new.clone()],
        &Wishes { used_again: vec![0, 1], ..Wishes::default() },
    );
    apply(&mut residency, vec![new.clone()], &again(u64::MAX));
    let words = apply(&mut residency, vec![strip(40, 3.0)], &Wishes::default());
    assert!(words.contains(&"refit"), "{words:?}");
    assert!(holds(&residency, &old) && !holds(&residency, &new));
}

/// A frame of a run; others have the device, too.
fn of_run(run: u64, others: &[u64], budget_bytes: u64) -> Wishes {
    let others = others.iter().copied().collect();
    Wishes { run, others, budget_bytes, update: Update::Refit, ..Wishes::default() }
}

#[test]
fn runs_that_take_turns_do_not_free_what_the_other_holds() {
    for same_faces in [false, true] {
        let mut residency = Residency::default();
        let (mut builds, mut held) = ([0; 2], Vec::new());
        for frame in 0..10 {
            for run in [1, 2] {
                let triangles = if same_faces { 40 } else { 40 + run as u32 };
                let object = strip(triangles, frame as f32 + 0.5 * run as f32);
                let words = apply(&mut residency, vec![object], &of_run(run, &[3 - run], u64::MAX));
                builds[run as usize - 1] += words.iter().filter(|&&word| word == "build").count();
            }
            held.push(residency.bytes());
        }
        assert_eq!(builds, [1, 1]);
        assert!(held.iter().all(|bytes| *bytes == held[0]), "{held:?}");
        assert_eq!(residency.evictions, 0);
    }
}

#[test]
fn what_a_run_used_goes_when_it_has_ended_or_there_is_no_space() {
    let (a, b) = (strip(40, 0.0), strip(50, 0.0));
    let both = |others: &[u64], budget_bytes| {
        let mut residency = Residency::default();
        let comes_again = Wishes { used_again: vec![0], ..of_run(1, &[2], budget_bytes) };
        apply(&mut residency, vec![a.clone()], &comes_again);
        let of_first = residency.bytes();
        apply(&mut residency, vec![b.clone()], &of_run(2, others, budget_bytes));
        assert!(holds(&residency, &b));
        (of_first, residency)
    };
    let (of_first, kept) = both(&[1], u64::MAX);
    assert!(holds(&kept, &a) && kept.holds_trees_of(1) && kept.holds_trees_of(2));
    let (_, ended) = both(&[], u64::MAX);
    assert!(ended.held.values().all(|held| held.users.iter().all(|user| user.run == 2)));
    assert_eq!(ended.evictions, 0);
    assert_eq!(ended.bytes(), kept.bytes() - of_first);
    let (_, tight) = both(&[1], kept.bytes() - 1);
    assert!(tight.evictions > 0 && tight.bytes() < kept.bytes());
}

#[test]
fn what_a_plan_keeps_is_not_idle_while_it_is_carried_out() {
    let mut residency = Residency::default();
    let still = strip(40, 0.0);
    apply(&mut residency, vec![still.clone()], &of_run(1, &[2], u64::MAX));
    apply(&mut residency, vec![strip(50, 0.0)], &of_run(2, &[1], u64::MAX));
    let frame = Frame { objects: vec![still.clone(), strip(60, 0.0)] };
    let plan = plan_frame(&frame, &residency, &of_run(1, &[2], u64::MAX));
    residency.begin(&plan);
    let idle = residency.idle();
    assert!(!idle.contains(&tree_name(&still.geometry)));
    assert!(still.geometry.parts().iter().all(|(name, _)| !idle.contains(name)));
    assert!(idle.contains(&tree_name(&strip(50, 0.0).geometry)));
}
