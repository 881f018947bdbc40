// Camera rays. Twin of src/kernel/camera.rs.

// The ray through (x, y) of the picture, in pixels from its upper left corner; its direction is unit.
fn camera_ray(x: f32, y: f32) -> Ray {
    let direction = shot.camera.forward
        + shot.camera.right * (x - shot.camera.center_x)
        + shot.camera.down * (y - shot.camera.center_y);
    return Ray(shot.camera.eye, direction * (1.0 / sqrt(dot(direction, direction))));
}
