//! Trees are fitted on the GPU: large ones, very many, and what that says of their costs.

use super::*;

/// A tree with so many nodes that one workgroup does not fit them all: built, and refitted to another place.
#[test]
fn a_large_tree_is_fitted_height_by_height() {
    let wave = |phase: f32| {
        one(scenes::sheet(
            120,
            |n| n % 2 == 1,
            |_, p| Vec3::new(p.x, p.y, 0.3 * libm::sinf(4.0 * p.x + phase) * libm::cosf(5.0 * p.y - phase)),
        ))
    };
    let frames = [wave(0.0), wave(1.5)];
    let shot = shot_at(1.0);
    let adapters = usable();
    let mut cpu = CpuDevice::new(2, BUDGET_BYTES).unwrap();
    for adapter in adapters {
        let (mut warm, mut cold) = (open(&adapter), open(&adapter));
        for i in [0, 1, 0] {
            let wishes = Wishes { update: Update::Refit, ..Wishes::default() };
            let film = picture_as(&mut warm, &frames[i], &shot, &wishes);
            let built = picture_as(&mut cold, &frames[i], &shot, &Wishes::cold());
            assert!(bytes(&film) == bytes(&built), "{}: frame {i}", adapter.name());
            let right = picture(&mut cpu, &frames[i], &shot);
            Agreement::new(&right, &film).check(&format!("{}: frame {i}", adapter.name()));
        }
        // what its tree costs is told with the frame itself, not with a later one
        let ratio = |device: &mut GpuDevice, wishes: &Wishes| {
            device.apply(&plan_frame(&frames[1], device.residency(), wishes), &frames[1]).unwrap();
            device.trace(&frames[1], &shot, &Stop::default()).unwrap().cost_ratio.unwrap()
        };
        assert_eq!(ratio(&mut cold, &Wishes::cold()), 1.0);
        assert!(ratio(&mut warm, &Wishes { update: Update::Refit, ..Wishes::default() }) > 1.001);
    }
}

#[test]
fn more_trees_are_fitted_than_a_dispatch_has_workgroups_in_one_direction() {
    let frame = scenes::very_many_trees();
    let shot = shot_at(1.0);
    let mut cpu = CpuDevice::new(2, BUDGET_BYTES).unwrap();
    let right = picture(&mut cpu, &frame, &shot);
    for adapter in usable() {
        let film = picture(&mut open(&adapter), &frame, &shot);
        Agreement::new(&right, &film).check(&adapter.name());
    }
}
