"""Writes the pictures of this folder by Pillow: 3 x 2 texels that tests/textures.rs knows, in every format that it can
write. Run here once; the files are kept."""

from PIL import Image

RGB = [(255, 0, 0), (0, 255, 0), (0, 0, 255), (10, 20, 30), (128, 128, 128), (255, 255, 255)]
ALPHA = [255, 128, 0, 1, 254, 255]


def picture(mode, texels):
    image = Image.new(mode, (3, 2))
    image.putdata(texels)
    return image


rgb = picture("RGB", RGB)
rgba = picture("RGBA", [c + (a,) for c, a in zip(RGB, ALPHA)])
gray = picture("L", ALPHA)
for name, options in {
    "rgb.png": {}, "rgb.bmp": {}, "rgb.tga": {"compression": "tga_rle"}, "rgb.ppm": {}, "rgb.gif": {},
    "rgb.webp": {"lossless": True}, "rgb.tif": {"compression": "tiff_lzw"}, "rgb.qoi": {},
}.items():
    rgb.save(name, **options)
for name, options in {"rgba.png": {}, "rgba.tga": {}, "rgba.webp": {"lossless": True, "exact": True}, "rgba.tif": {}, "rgba.qoi": {}}.items():
    rgba.save(name, **options)
gray.save("gray.png")
gray.save("gray.tga")
gray.save("gray.pgm")
picture("LA", list(zip([10] * 6, ALPHA))).save("gray_alpha.png")
rgb.quantize(6).save("palette.png")
picture("I;16", [257 * a for a in ALPHA]).save("gray16.png")
# colours by and large: whole blocks of one colour
for name, options in {"red.jpg": {"quality": 95}, "red.webp": {"quality": 90}, "red.dds": {"pixel_format": "DXT1"}}.items():
    Image.new("RGB", (16, 16), (200, 40, 40)).save(name, **options)
