//! Encoders, atomic files, records of finished frames, and pictures read back to be compared.
//!
//! A film becomes the bytes of its files ([`picture_files`]); [`finish`] brings them into their places, the frame's
//! record before them. A picture file is whole or absent, and its bytes are a function of the film and the encoding.

mod atomic;
mod compare;
mod difference;
mod encoding;
mod error;
mod exr;
mod finish;
mod hdr;
mod jp2;
mod listing;
mod mark;
mod owner;
mod png;
mod pnm;
mod rasters;
mod read;
mod record_name;
mod records;
mod run_log;
mod sun;
mod tiff;

pub use atomic::{make_writable, write_atomic};
pub use compare::{PictureComparison, PictureOutcome, compare_paths};
pub use difference::first_difference;
pub use encoding::{Bits, Encoding, Format, PictureFile, encode, file_names, picture_files};
pub use error::OutputError;
pub use finish::{clean_up, finish, foreign};
pub use listing::{gone, keep_listing};
pub use mark::has_mark;
pub use owner::{is_gone, own_name};
pub use read::read_picture;
pub use records::Records;
pub use run_log::RunLog;
