//! JPEG 2000, lossless, by the openjp2 crate (a port of `OpenJPEG`). The only unsafe code of this room is what its
//! output stream asks for: callbacks with a pointer to our buffer.

use super::encoding::{Bits, Encoding};
use crate::film::Film;
use crate::film::quantize::quantize16;
use openjp2::openjpeg::{
    OPJ_CODEC_JP2, opj_stream_set_seek_function, opj_stream_set_skip_function, opj_stream_set_user_data,
    opj_stream_set_write_function, opj_stream_t,
};
use openjp2::{Codec, Stream, opj_cparameters_t, opj_image, opj_image_comptparm};
use std::ffi::c_void;

/// RGB, 8 or 16 bits, no alpha.
#[allow(clippy::field_reassign_with_default, reason = "the parameters have a destructor")]
pub(super) fn encode(film: &Film, encoding: Encoding) -> Result<Vec<u8>, String> {
    let [width, height] = film.size;
    let stops = encoding.exposure_stops;
    let (bits, samples): (u32, Vec<i32>) = match encoding.bits {
        Bits::Eight => (8, film.codes(false, stops).iter().copied().map(i32::from).collect()),
        Bits::Sixteen => (16, quantize16(&film.rgb, None, stops).into_iter().map(i32::from).collect()),
    };
    let component = opj_image_comptparm {
        dx: 1,
        dy: 1,
        w: width,
        h: height,
        x0: 0,
        y0: 0,
        prec: bits,
        bpp: bits,
        sgnd: 0,
    };
    let components = [component, component, component];
    let mut image =
        opj_image::create(&components, openjp2::OPJ_CLRSPC_SRGB).ok_or("there is no memory for it")?;
    image.x1 = width;
    image.y1 = height;
    for (k, component) in image.comps_mut().unwrap_or_default().iter_mut().enumerate() {
        let values = component.data_mut().ok_or("there is no memory for it")?;
        for (value, sample) in values.iter_mut().zip(samples.iter().skip(k).step_by(3)) {
            *value = *sample;
        }
    }
    let mut parameters = opj_cparameters_t::default();
    parameters.tcp_numlayers = 1;
    parameters.cp_disto_alloc = 1;
    parameters.tcp_mct = 1;
    // small pictures cannot be halved six times
    parameters.numresolution = (width.min(height).ilog2() + 1).min(6) as i32;
    // without one the encoder writes its name, and the codestream may not have an empty one
    parameters.set_comment(" ");
    let mut codec = Codec::new_encoder(OPJ_CODEC_JP2).ok_or("the encoder is not there")?;
    let done =
        |ok: i32, what: &str| if ok == 1 { Ok(()) } else { Err(format!("the encoder fails to {what}")) };
    done(codec.setup_encoder(&mut parameters, &mut image), "start")?;
    let mut output = Output::default();
    output.stream(|stream| {
        done(codec.start_compress(&mut image, stream), "write its header")?;
        done(codec.encode(stream), "compress")?;
        done(codec.end_compress(stream), "end")
    })?;
    Ok(output.bytes)
}

/// What the encoder writes into; it goes back to fill in lengths.
#[derive(Default)]
struct Output {
    bytes: Vec<u8>,
    place: usize,
}

impl Output {
    /// Runs an encoder over a stream that writes here; what the stream still holds then is written too.
    fn stream<T>(&mut self, encode: impl FnOnce(&mut Stream) -> T) -> T {
        let mut stream = Stream::new_custom(1 << 16, false);
        let handle: *mut opj_stream_t = std::ptr::from_mut(&mut stream).cast();
        // SAFETY: `handle` points to a `Stream`, which is what the crate makes of it again. The callbacks get the
        // pointer to `self` given here, which outlives `stream`: that is dropped when this function returns or unwinds,
        // and `self` is borrowed until then.
        unsafe {
            opj_stream_set_user_data(handle, std::ptr::from_mut(self).cast(), None);
            opj_stream_set_write_function(handle, Some(write));
            opj_stream_set_skip_function(handle, Some(skip));
            opj_stream_set_seek_function(handle, Some(seek));
        }
        encode(&mut stream)
    }

    fn write(&mut self, new: &[u8]) {
        let end = self.place + new.len();
        if self.bytes.len() < end {
            self.bytes.resize(end, 0);
        }
        self.bytes[self.place..end].copy_from_slice(new);
        self.place = end;
    }

    /// Goes to a place; false where there is none such.
    fn go(&mut self, place: Option<i64>) -> bool {
        let place = place.and_then(|place| usize::try_from(place).ok());
        self.place = place.unwrap_or(self.place);
        place.is_some()
    }
}

// SAFETY: called with `count` readable bytes of a slice and the pointer given to `opj_stream_set_user_data`, which is a
// valid `Output` that nothing else uses meanwhile.
unsafe extern "C" fn write(bytes: *mut c_void, count: usize, output: *mut c_void) -> usize {
    // SAFETY: as above.
    let (bytes, output) =
        unsafe { (std::slice::from_raw_parts(bytes.cast::<u8>(), count), &mut *output.cast::<Output>()) };
    output.write(bytes);
    count
}

// SAFETY: called with the pointer given to `opj_stream_set_user_data`, as `write` is.
unsafe extern "C" fn skip(count: i64, output: *mut c_void) -> i64 {
    // SAFETY: as above.
    let output = unsafe { &mut *output.cast::<Output>() };
    if output.go((output.place as i64).checked_add(count)) { count } else { -1 }
}

// SAFETY: called with the pointer given to `opj_stream_set_user_data`, as `write` is.
unsafe extern "C" fn seek(place: i64, output: *mut c_void) -> i32 {
    // SAFETY: as above.
    let output = unsafe { &mut *output.cast::<Output>() };
    i32::from(output.go(Some(place)))
}
