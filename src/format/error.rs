//! What stops a file from being read.

use std::io;
use std::path::PathBuf;
use thiserror::Error;

/// Why a file gives no scene. Each names the file, the line where there is one, the cause and the remedy.
#[derive(Debug, Error)]
pub enum FormatError {
    /// The file or its folder cannot be read.
    #[error("{}: cannot be read: {cause}; check that it exists and that its permissions allow reading", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system said.
        cause: io::Error,
    },
    /// A folder, a pipe or a device stands where a file should.
    #[error("{}: is not a plain file, but a folder, a pipe or a device; name a file", path.display())]
    NotAFile {
        /// What was named.
        path: PathBuf,
    },
    /// The file is longer than its vertices and corners can be counted in 32 bits.
    #[error("{}: has {bytes} bytes, more than the {limit} that one file may have; split it", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its length.
        bytes: u64,
        /// The greatest length.
        limit: u64,
    },
    /// The placeholder that Git LFS leaves where a file was not fetched.
    #[error("{}:1: is a Git LFS pointer, not the file itself; fetch it with `git lfs pull`", path.display())]
    LfsPointer {
        /// The file.
        path: PathBuf,
    },
    /// Text in 16-bit units.
    #[error("{}:1: is UTF-16 text; convert it, e.g. with `iconv -f UTF-16 -t UTF-8`", path.display())]
    Utf16 {
        /// The file.
        path: PathBuf,
    },
    /// An OBJ with a zero byte.
    #[error("{}:{line}: is binary, not text; export it again, or name an OBJ file", path.display())]
    Binary {
        /// The file.
        path: PathBuf,
        /// Line of the first zero byte, from 1.
        line: u32,
    },
    /// An OBJ in which nothing is a statement of one.
    #[error("{}:{line}: is no OBJ: none of its lines is a statement of one, the first is `{statement}`; export it again, or name an OBJ file", path.display())]
    NoObj {
        /// The file.
        path: PathBuf,
        /// Line of the first statement, from 1.
        line: u32,
        /// That line, shortened.
        statement: String,
    },
    /// A picture that is broken, too large or of no known format.
    #[error("{}: {cause}", path.display())]
    BadPicture {
        /// The file.
        path: PathBuf,
        /// What is wrong with it and what to do.
        cause: String,
    },
    /// A glTF that is broken, or asks for what is not there.
    #[error("{}: {cause}", path.display())]
    BadGltf {
        /// The file.
        path: PathBuf,
        /// What is wrong with it and what to do.
        cause: String,
    },
    /// The textures of one frame take more memory than is allowed.
    #[error(
        "{}: its textures need more than {needed_bytes} bytes, {limit_bytes} are allowed; the frame is not rendered (raise --memory, or scale them down)", path.display()
    )]
    TexturesTooLarge {
        /// The OBJ.
        path: PathBuf,
        /// What those that were looked at need.
        needed_bytes: u64,
        /// What is allowed.
        limit_bytes: u64,
    },
    /// A face that cannot be what its author meant.
    #[error("{}:{line}: {cause}; the frame is not rendered (--lenient drops the face)", path.display())]
    BadFace {
        /// The OBJ.
        path: PathBuf,
        /// Line of the face, from 1.
        line: u32,
        /// What is wrong with it.
        cause: String,
    },
    /// A material override whose value the word cannot take.
    #[error(
        "material override `{name}`: `{word} {value}` is not understood; give what an MTL file may have there"
    )]
    BadOverride {
        /// The material's name.
        name: String,
        /// The MTL word.
        word: String,
        /// The value.
        value: String,
    },
}
