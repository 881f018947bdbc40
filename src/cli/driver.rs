//! What drivers are told by the environment.

/// Mesa's layer that picks a device asks a display server which, and complains on stderr where there is none; here devices
/// are picked by name. To be called before there are threads.
pub(super) fn needs_no_display() {
    const NAME: &str = "NODEVICE_SELECT";
    if std::env::var_os(NAME).is_none() {
        // SAFETY: the program begins with this call: no other thread reads or writes the environment.
        unsafe { std::env::set_var(NAME, "1") }
    }
}
