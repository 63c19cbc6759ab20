// From values to colours: stretches of the image, colour-blind safe scales for planes.
const ANCHORS = {
  grey: ["#000000", "#ffffff"],
  // cividis: the same to all eyes, evenly brighter.
  cividis: ["#00224e", "#123570", "#3b496c", "#575d6d", "#707173", "#8a8678", "#a59c74", "#c3b369", "#e1cc55", "#fee838"],
  // blue to orange through dark, for values about zero.
  split: ["#6fc3ff", "#2a74b3", "#173a57", "#101010", "#5a3a10", "#b5761a", "#ffbf5a"],
  // round: the same at both ends, for longitudes and azimuths.
  round: ["#173a57", "#56b4e9", "#e8edf2", "#e69f00", "#5a3a10", "#173a57"],
};

function scaleOf(name) {
  const anchors = ANCHORS[name].map((text) => [1, 3, 5].map((at) => parseInt(text.slice(at, at + 2), 16)));
  const table = new Uint32Array(256);
  for (let i = 0; i < 256; i++) {
    const place = (i / 255) * (anchors.length - 1), low = Math.min(Math.floor(place), anchors.length - 2);
    const [r, g, b] = [0, 1, 2].map((c) => Math.round(anchors[low][c] + (place - low) * (anchors[low + 1][c] - anchors[low][c])));
    table[i] = (255 << 24) | (b << 16) | (g << 8) | r;
  }
  return table;
}
const SCALES = Object.fromEntries(Object.keys(ANCHORS).map((name) => [name, scaleOf(name)]));

export const isRound = (plane) => /longitude|azimuth|right_ascension/.test(plane) && !/uncertainty/.test(plane);
export const isImage = (plane) => /^(image|simulation)/.test(plane);
export const scaleName = (plane) => isImage(plane) ? "grey" : plane.startsWith("residual") ? "split" : isRound(plane) ? "round" : "cividis";

// Sorted sample of the finite values: percentiles and limits come from it.
export function sampled(values) {
  const step = Math.max(1, Math.floor(values.length / 20000)), found = [];
  for (let i = 0; i < values.length; i += step) if (Number.isFinite(values[i])) found.push(values[i]);
  return Float64Array.from(found).sort();
}
export function percentile(sorted, percent) {
  if (!sorted.length) return NaN;
  const place = Math.min(Math.max(percent / 100, 0), 1) * (sorted.length - 1), low = Math.floor(place);
  return sorted[low] + (place - low) * ((sorted[low + 1] ?? sorted[low]) - sorted[low]);
}

// {low, high} that a plane is drawn between.
export function limitsOf(plane, sorted, stretch) {
  if (plane.startsWith("residual")) {
    const far = Math.max(Math.abs(percentile(sorted, 1)), Math.abs(percentile(sorted, 99)), 1e-9);
    return { low: -far, high: far };
  }
  if (isRound(plane)) return { low: 0, high: 360 };
  if (isImage(plane)) {
    if (stretch.kind === "linear") return { low: sorted[0] ?? 0, high: sorted[sorted.length - 1] ?? 1 };
    return { low: percentile(sorted, stretch.low), high: percentile(sorted, stretch.high) };
  }
  return { low: percentile(sorted, 0.5), high: percentile(sorted, 99.5) };
}

// A canvas with the values (width x height) as colours; transparent where nothing is known.
export function painted(values, width, height, plane, limits, stretch, contour = 0) {
  const canvas = new OffscreenCanvas(width, height), context = canvas.getContext("2d");
  const picture = context.createImageData(width, height), pixels = new Uint32Array(picture.data.buffer);
  const table = SCALES[scaleName(plane)], { low, high } = limits, span = high - low || 1;
  const curve = new Uint8ClampedArray(4096), image = isImage(plane);
  for (let i = 0; i < 4096; i++) {
    const share = i / 4095;
    const bent = !image || stretch.kind === "linear" || stretch.kind === "percentile" ? share
      : stretch.kind === "log" ? Math.log1p(1000 * share) / Math.log1p(1000) : share ** stretch.gamma;
    curve[i] = Math.round(255 * bent);
  }
  const count = width * height;
  for (let i = 0; i < count; i++) {
    const value = values[i];
    if (value !== value) continue;
    const share = (value - low) / span;
    pixels[i] = table[curve[share <= 0 ? 0 : share >= 1 ? 4095 : (share * 4095) | 0]];
  }
  if (contour > 0) {
    const line = 0xffffffff;
    for (let y = 0; y < height - 1; y++) {
      for (let x = 0; x < width - 1; x++) {
        const i = y * width + x, step = Math.floor(values[i] / contour);
        const right = Math.floor(values[i + 1] / contour), below = Math.floor(values[i + width] / contour);
        const near = (a, b) => a === a && b === b && a !== b && Math.abs(a - b) * contour < 180;
        if (near(step, right) || near(step, below)) pixels[i] = line;
      }
    }
  }
  context.putImageData(picture, 0, 0);
  return canvas;
}

// Pixels that carry a flag, in orange.
export function flagged(values, width, height, mask) {
  const canvas = new OffscreenCanvas(width, height), context = canvas.getContext("2d");
  const picture = context.createImageData(width, height), pixels = new Uint32Array(picture.data.buffer);
  for (let i = 0; i < width * height; i++) if (values[i] & mask) pixels[i] = 0xb0009fe6;
  context.putImageData(picture, 0, 0);
  return canvas;
}

export function drawLegend(canvas, plane) {
  const context = canvas.getContext("2d"), table = SCALES[scaleName(plane)];
  for (let x = 0; x < canvas.width; x++) {
    const colour = table[Math.round((255 * x) / (canvas.width - 1))];
    context.fillStyle = `rgb(${colour & 255} ${(colour >> 8) & 255} ${(colour >> 16) & 255})`;
    context.fillRect(x, 0, 1, canvas.height);
  }
}
