//! JPEG 2000, lossless, by the openjp2 crate (a port of `OpenJPEG`). The only unsafe code of this room is what its
//! output stream asks for: callbacks with a pointer to our buffer.

use super::encoding::{Bits, Encoding};
use crate::film::Film;
use crate::film::quantize::{quantize8, quantize16};
use openjp2::openjpeg::{
    OPJ_CODEC_JP2, opj_stream_create, opj_stream_destroy, opj_stream_set_seek_function,
    opj_stream_set_skip_function, opj_stream_set_user_data, opj_stream_set_write_function, opj_stream_t,
};
use openjp2::{Codec, Stream, opj_cparameters_t, opj_image, opj_image_comptparm};
use std::ffi::c_void;

/// RGB, 8 or 16 bits, no alpha.
#[allow(clippy::field_reassign_with_default, reason = "the parameters have a destructor")]
pub(super) fn encode(film: &Film, encoding: Encoding) -> Result<Vec<u8>, String> {
    let [width, height] = film.size;
    let stops = encoding.exposure_stops;
    let (bits, samples): (u32, Vec<i32>) = match encoding.bits {
        Bits::Eight => (8, quantize8(&film.rgb, None, stops).into_iter().map(i32::from).collect()),
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
    parameters.set_comment("");
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
    /// Runs an encoder over a stream that writes here.
    fn stream<T>(&mut self, encode: impl FnOnce(&mut Stream) -> T) -> T {
        // SAFETY: the stream is made here, is not null, and is destroyed before `self` is used again; the callbacks
        // get the pointer to `self` that is set here and take nothing else for granted
        unsafe {
            let stream: *mut opj_stream_t = opj_stream_create(1 << 16, 0);
            opj_stream_set_user_data(stream, std::ptr::from_mut(self).cast(), None);
            opj_stream_set_write_function(stream, Some(write));
            opj_stream_set_skip_function(stream, Some(skip));
            opj_stream_set_seek_function(stream, Some(seek));
            let result = encode(&mut *stream.cast::<Stream>());
            opj_stream_destroy(stream);
            result
        }
    }

    fn write(&mut self, new: &[u8]) {
        let end = self.place + new.len();
        if self.bytes.len() < end {
            self.bytes.resize(end, 0);
        }
        self.bytes[self.place..end].copy_from_slice(new);
        self.place = end;
    }
}

// SAFETY: called by the encoder with `count` readable bytes and the pointer given to `opj_stream_set_user_data`, which
// is a valid `Output` that nothing else uses meanwhile
unsafe extern "C" fn write(bytes: *mut c_void, count: usize, output: *mut c_void) -> usize {
    // SAFETY: as above
    let (bytes, output) =
        unsafe { (std::slice::from_raw_parts(bytes.cast::<u8>(), count), &mut *output.cast::<Output>()) };
    output.write(bytes);
    count
}

// SAFETY: called with the pointer given to `opj_stream_set_user_data`
unsafe extern "C" fn skip(count: i64, output: *mut c_void) -> i64 {
    // SAFETY: as above
    let output = unsafe { &mut *output.cast::<Output>() };
    match usize::try_from(output.place as i64 + count) {
        Ok(place) => {
            output.place = place;
            count
        }
        Err(_) => -1,
    }
}

// SAFETY: called with the pointer given to `opj_stream_set_user_data`
unsafe extern "C" fn seek(place: i64, output: *mut c_void) -> i32 {
    // SAFETY: as above
    let output = unsafe { &mut *output.cast::<Output>() };
    usize::try_from(place).map_or(0, |place| {
        output.place = place;
        1
    })
}
