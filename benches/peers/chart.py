#!/usr/bin/env python3
"""Bars of what whole_job.py measured: python benches/peers/chart.py whole.json docs/whole-job.svg"""
import html, json, sys

ROW, LEFT, WIDTH = 26, 300, 420


def bars(found):
    rows = sorted((r for r in found["rows"] if "median" in r), key=lambda r: -r["median"])
    scale = WIDTH / max(r["greatest"] for r in rows)
    scene, machine = found["scene"], found["machine"]
    title = f"{scene['frames']} OBJ frames to PNG, {scene['size']}, {scene['samples']} sample{'s' * (scene['samples'] > 1)} a pixel, {machine['cores']} cores: frames/s, start to end"
    height = ROW * len(rows) + 48
    yield f'<svg xmlns="http://www.w3.org/2000/svg" width="{LEFT + WIDTH + 80}" height="{height}" font-family="sans-serif" font-size="13">'
    yield f'<rect width="100%" height="100%" fill="white"/><text x="12" y="24" font-size="14">{html.escape(title)}</text>'
    for i, r in enumerate(rows):
        y = 40 + ROW * i
        color = "#d9822b" if r["peer"] == "rentix" else "#bbbbbb" if "raster" in r["peer"] else "#5b7fa6"
        middle = y + 9
        yield f'<text x="{LEFT - 8}" y="{y + 14}" text-anchor="end">{html.escape(r["peer"])}</text>'
        yield f'<rect x="{LEFT}" y="{y}" width="{r["median"] * scale:.1f}" height="18" fill="{color}"/>'
        yield f'<path d="M{LEFT + r["least"] * scale:.1f} {middle}H{LEFT + r["greatest"] * scale:.1f}" stroke="black"/>'
        yield f'<text x="{LEFT + r["greatest"] * scale + 8:.1f}" y="{y + 14}">{r["median"]:.3g}</text>'
    yield "</svg>"


if __name__ == "__main__":
    with open(sys.argv[1]) as file:
        found = json.load(file)
    with open(sys.argv[2], "w") as file:
        file.write("\n".join(bars(found)) + "\n")
