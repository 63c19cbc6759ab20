// The image: deep zoom of its planes, curves over it, values under the mouse.
import { flagged, drawLegend, limitsOf, painted, sampled } from "./colours.js";
import { Tiles } from "./tiles.js";

const STYLE = {
  limb: { colour: "#56b4e9", dash: [], width: 1.7 },
  predicted: { colour: "#e69f00", dash: [7, 5], width: 1.7 },
  before: { colour: "#cc79a7", dash: [2, 3], width: 1.7 },
  terminator: { colour: "#f0e442", dash: [1.5, 3], width: 2 },
  grid: { colour: "rgba(255,255,255,.62)", dash: [], width: 0.8 },
  help: { colour: "#e69f00", dash: [3, 3], width: 2.2 },
  other: { colour: "#cc79a7", dash: [], width: 1.5 },
  ring: { colour: "#cc79a7", dash: [1.5, 3], width: 1 },
  flow: { colour: "#2fc18c", dash: [], width: 1.3 },
  star: { colour: "#f0e442", dash: [], width: 1.3 },
};
const LARGEST_SCALE = 40;
const ARROW_PX = 22;  // on the screen, of the longest tenth of the shifts
const STAR_PX = 7;
const sampleKey = (page, side, plane) => `${side}/${page.product}/${page.version ?? 0}/${plane}`;

export class Picture {
  constructor(canvas, on) {
    Object.assign(this, { canvas, on, page: null, scale: 1, centre: [0, 0], plane: "image", other: "simulation" });
    Object.assign(this, { colour: "", opacity: 0.6, contour: 0, flag: 0, blink: false, swipe: null, side: 0, otherSide: 0 });
    this.stretch = { kind: "percentile", low: 0.5, high: 99.8, gamma: 0.65 };
    this.layers = { limb: true, predicted: true, grid: false, terminator: false, flow: false, others: true, stars: true };
    this.flow = null;
    this.help = null; this.mask = null; this.measure = null; this.earlier = null; this.phase = 0; this.statistics = new Map();
    this.tiles = new Tiles((plane) => { this.redraw(); on.loaded?.(plane); });
    this.context = canvas.getContext("2d");
    new ResizeObserver(() => this.resized()).observe(canvas);
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.moved(event));
    canvas.addEventListener("pointerup", (event) => this.up(event));
    canvas.addEventListener("pointerleave", () => on.hover(null));
  }

  resized() {
    const ratio = window.devicePixelRatio || 1, first = !this.width;
    [this.width, this.height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    this.canvas.width = Math.max(1, Math.round(this.width * ratio));
    this.canvas.height = Math.max(1, Math.round(this.height * ratio));
    if (first && this.page) this.fit();
    this.redraw();
  }

  show(page, keepView) {
    const same = keepView && this.page && String(this.page.size_px) === String(page.size_px);
    this.page = page; this.help = null; this.mask = null; this.measure = null; this.drawnAt = null;
    if (!page.planes.some((each) => each.name === this.plane)) this.plane = "image";
    if (!same) this.fit(); else this.redraw();
  }

  fit() {
    if (!this.page || !this.width) return;
    const [nx, ny] = this.page.size_px;
    this.look([(nx - 1) / 2, (ny - 1) / 2], Math.min(this.width / nx, this.height / ny) * 0.98);
  }

  fitDisk() {
    const points = this.page?.curves.after.limb.filter(Boolean) ?? [];
    if (points.length < 3) return this.fit();
    const [low, high] = [Math.min, Math.max].map((of) => [0, 1].map((i) => of(...points.map((point) => point[i]))));
    const size = Math.max(high[0] - low[0], high[1] - low[1], 4);
    this.look([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2], Math.min(this.width, this.height) / size / 1.15);
  }

  look(centre, scale) {
    this.centre = centre;
    this.scale = Math.min(Math.max(scale, 0.02), LARGEST_SCALE);
    this.redraw();
  }

  zoom(factor, about = [this.width / 2, this.height / 2]) {
    const fixed = this.pixelAt(about), scale = Math.min(Math.max(this.scale * factor, 0.02), LARGEST_SCALE);
    this.look([0, 1].map((i) => fixed[i] - (about[i] - [this.width, this.height][i] / 2) / scale), scale);
  }

  pixelAt([x, y]) { return [this.centre[0] + (x - this.width / 2) / this.scale, this.centre[1] + (y - this.height / 2) / this.scale]; }
  screenAt([x, y]) { return [(x - this.centre[0]) * this.scale + this.width / 2, (y - this.centre[1]) * this.scale + this.height / 2]; }
  redraw() { if (!this.waiting) { this.waiting = true; requestAnimationFrame(() => { this.waiting = false; this.draw(); }); } }

  draw() {
    const { context, page } = this, ratio = window.devicePixelRatio || 1;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = "#000";
    context.fillRect(0, 0, this.width, this.height);
    if (!page || !this.width) return;
    context.imageSmoothingEnabled = this.scale < 1;
    const showOther = this.blink && this.phase % 2 === 1;
    let complete = this.drawPlane(showOther ? this.other : this.plane, showOther ? this.otherSide : this.side, 1);
    if (this.swipe !== null) {
      context.save();
      context.beginPath();
      context.rect(this.swipe * this.width, 0, this.width, this.height);
      context.clip();
      context.fillRect(0, 0, this.width, this.height);
      this.drawPlane(this.other, this.otherSide, 1);
      context.restore();
      this.line([[this.swipe * this.width, 0], [this.swipe * this.width, this.height]], { colour: "#fff", dash: [], width: 1 }, true);
    }
    if (this.colour) complete = this.drawPlane(this.colour, this.side, this.opacity, this.contour) && complete;
    if (this.flag) this.drawFlags();
    if (this.mask) this.drawMask();
    this.drawCurves();
    if (complete && this.drawnAt === null) { this.drawnAt = performance.now(); this.on.drawn?.(page); }
  }

  // Every tile of a plane that is in sight; whether all were there. Until they are, what came with the page is drawn.
  drawPlane(plane, side, opacity, contour = 0) {
    const { page, context } = this, limits = this.limits(plane, side);
    if (!limits) return Boolean(this.tiles.faults.get(`${page.product}/${plane}`));
    const ratio = window.devicePixelRatio || 1, first = page.opening?.plane === plane && side === this.side ? page.opening.level : null;
    let level = Math.min(Math.max(Math.floor(Math.log2(1 / (this.scale * ratio))), 0), page.levels - 1);
    if (first !== null && level > first) level = first;
    const image = JSON.stringify([limits, this.stretch, contour]);
    context.globalAlpha = opacity;
    const levels = first === null || level === first || this.hasAll(plane, side, level) ? [level] : [first, level];
    const complete = levels.map((each) => this.drawLevel(plane, side, each, limits, contour, image));
    context.globalAlpha = 1;
    return complete.some(Boolean);
  }

  hasAll(plane, side, level) { return [...this.inSight(level)].every((place) => this.tiles.get(this.page, side, plane, level, ...place)); }

  drawLevel(plane, side, level, limits, contour, image) {
    let complete = true;
    for (const [column, row] of this.inSight(level)) {
      const tile = this.tiles.get(this.page, side, plane, level, column, row);
      if (!tile) { complete = false; continue; }
      if (tile.image !== image) {
        tile.canvas = painted(tile.values, tile.width, tile.height, plane, limits, this.stretch, contour);
        tile.image = image;
      }
      this.drawTile(tile.canvas, level, column, row, tile);
    }
    return complete;
  }

  drawTile(canvas, level, column, row, tile) {
    const size = 2 ** level, { tile_px: side } = this.page;
    const [x, y] = this.screenAt([column * side * size - 0.5, row * side * size - 0.5]);
    this.context.drawImage(canvas, x, y, tile.width * size * this.scale, tile.height * size * this.scale);
  }

  *inSight(level) {
    const side = this.page.tile_px * 2 ** level;
    const [x0, y0] = this.pixelAt([0, 0]), [x1, y1] = this.pixelAt([this.width, this.height]);
    const last = Tiles.count(this.page, level).map((count) => count - 1);
    for (let row = Math.max(Math.floor(y0 / side), 0); row <= Math.min(Math.floor(y1 / side), last[1]); row++)
      for (let column = Math.max(Math.floor(x0 / side), 0); column <= Math.min(Math.floor(x1 / side), last[0]); column++) yield [column, row];
  }

  // Limits of a plane, from what came with the page or else its coarsest level, which is one tile; null until that is
  // there.
  limits(plane, side) {
    const key = sampleKey(this.page, side, plane);
    if (!this.statistics.has(key)) {
      const tile = this.tiles.get(this.page, side, plane, this.page.levels - 1, 0, 0);
      if (!tile) return null;
      this.sample(key, tile.values);
    }
    const found = limitsOf(plane.startsWith("simulation") && !side ? "image" : plane, this.statistics.get(key), this.stretch);
    // A simulation is compared with the image: the same greys.
    if (plane.startsWith("simulation") && plane !== this.plane) return this.limits("image", side) ?? found;
    return found;
  }

  sample(key, values) {
    if (this.statistics.size > 200) this.statistics.clear();
    this.statistics.set(key, sampled(values));
  }

  // A page and the values that came with it.
  take({ page, values }, side = 0) {
    if (!values) return;
    this.tiles.put(page, side, page.opening, values);
    const key = sampleKey(page, side, page.opening.plane);
    if (!this.statistics.has(key)) this.sample(key, values);
  }

  drawFlags() {
    for (const [column, row] of this.inSight(0)) {
      const tile = this.tiles.get(this.page, this.side, "quality", 0, column, row);
      if (!tile) continue;
      if (tile.flag !== this.flag) { tile.flagCanvas = flagged(tile.values, tile.width, tile.height, this.flag); tile.flag = this.flag; }
      this.drawTile(tile.flagCanvas, 0, column, row, tile);
    }
  }

  drawMask() {
    const [x, y] = this.screenAt([-0.5, -0.5]), [nx, ny] = this.page.size_px;
    this.context.globalAlpha = 0.55;
    this.context.drawImage(this.mask, x, y, nx * this.scale, ny * this.scale);
    this.context.globalAlpha = 1;
  }

  drawCurves() {
    const { curves } = this.page, { layers } = this;
    if (layers.grid) {
      for (const line of curves.after.grid) this.line(line, STYLE.grid);
      this.context.font = "12px system-ui, sans-serif";
      this.context.textAlign = "center";
      for (const { text, xy } of curves.after.labels) this.text(text, this.screenAt(xy));
    }
    if (layers.terminator) this.line(curves.after.terminator, STYLE.terminator);
    if (this.earlier?.product === this.page.product) this.line(this.earlier.limb, STYLE.before);
    if (layers.predicted) this.line(curves.before.limb, STYLE.predicted);
    if (layers.limb) this.line(curves.after.limb, STYLE.limb);
    if (layers.others) for (const other of this.page.others ?? []) this.drawOther(other);
    if (layers.stars) for (const star of this.page.stars ?? []) this.drawStar(star);
    if (layers.flow) this.drawFlow();
    if (this.help) this.line(this.helpOutline(), STYLE.help);
    if (this.measure?.length === 2) {
      this.line(this.measure, { colour: "#fff", dash: [], width: 1.5 });
      this.context.font = "13px system-ui, sans-serif";
      this.context.textAlign = "left";
      if (this.measured) this.text(this.measured, this.screenAt(this.measure[1]));
    }
  }

  drawOther({ name, limb, rings, measured_px: measured, predicted_px: predicted }) {
    this.line(limb, STYLE.other);
    for (const ring of rings) this.line(ring, STYLE.ring);
    if (measured) this.cross(measured, STYLE.other);
    const top = limb.filter(Boolean).reduce((best, point) => (!best || point[1] < best[1] ? point : best), null) ?? predicted;
    if (top && limb.length) this.text(name, this.screenAt(top));
  }

  drawStar({ xy, star, magnitude, used }) {
    const [x, y] = this.screenAt(xy), circle = [];
    if (!star) {  // a star image that no star was found for
      const square = [[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]].map(([dx, dy]) => [x + 5 * dx, y + 5 * dy]);
      return this.line(square, { ...STYLE.star, width: 0.9 }, true);
    }
    for (let i = 0; i <= 24; i++) circle.push([x + STAR_PX * Math.cos(i * Math.PI / 12), y + STAR_PX * Math.sin(i * Math.PI / 12)]);
    this.line(circle, { ...STYLE.star, dash: used ? [] : [2, 2] }, true);
    this.context.font = "11px system-ui, sans-serif";
    if (Number.isFinite(magnitude)) this.text(magnitude.toFixed(1), [x + STAR_PX + 10, y + 4]);
  }

  cross(point, style, size = 5) {
    const [x, y] = this.screenAt(point);
    this.line([[x - size, y], [x + size, y], null, [x, y - size], [x, y + size]], style, true);
  }

  // How many times the shifts are drawn enlarged, so that most of them fit between their neighbours.
  flowScale() {
    const lengths = (this.flow?.vectors ?? []).map(([, , dx, dy]) => Math.hypot(dx, dy)).sort((a, b) => a - b);
    const long = lengths[Math.floor(0.9 * lengths.length)] || 1, most = ARROW_PX / (long * this.scale);
    const step = 10 ** Math.floor(Math.log10(most));
    return Math.max([5, 2, 1].find((each) => each * step <= most) * step, 1);
  }

  drawFlow() {
    if (this.flow?.product !== this.page.product) return;
    const times = this.flowScale(), lines = [];
    for (const [x, y, dx, dy] of this.flow.vectors) {
      const [x0, y0] = this.screenAt([x, y]), [x1, y1] = this.screenAt([x + times * dx, y + times * dy]);
      const long = Math.hypot(x1 - x0, y1 - y0) || 1, [ux, uy] = [(x1 - x0) / long, (y1 - y0) / long], head = Math.min(5, long / 2);
      lines.push([x0, y0], [x1, y1], null, [x1 - head * (ux + 0.6 * uy), y1 - head * (uy - 0.6 * ux)], [x1, y1], [x1 - head * (ux - 0.6 * uy), y1 - head * (uy + 0.6 * ux)], null);
    }
    this.line(lines, STYLE.flow, true);
    const { median_px: median, share, vectors } = this.flow;
    const words = vectors.length ? `shifts x ${times}: median ${median.toFixed(3)} px, ${Math.round(100 * share)} % of the markings match` : "no marking matches";
    this.context.font = "12px system-ui, sans-serif";
    this.context.textAlign = "left";
    this.text(words, [8, this.height - 8]);
  }

  // The predicted limb moved, scaled and rolled as the help says.
  helpOutline() {
    const { x, y, range, roll } = this.help, [cx, cy] = this.page.predicted_centre_px;
    const [cos, sin] = [Math.cos((roll * Math.PI) / 180) / range, Math.sin((roll * Math.PI) / 180) / range];
    return this.page.curves.before.limb.map((point) => point && [
      x + cos * (point[0] - cx) - sin * (point[1] - cy), y + sin * (point[0] - cx) + cos * (point[1] - cy),
    ]);
  }

  line(points, style, onScreen = false) {
    const { context } = this;
    for (const [colour, width] of [["rgba(0,0,0,.55)", style.width + 1.6], [style.colour, style.width]]) {
      context.beginPath();
      let drawing = false;
      for (const point of points) {
        if (!point) { drawing = false; continue; }
        const [x, y] = onScreen ? point : this.screenAt(point);
        if (drawing) context.lineTo(x, y); else context.moveTo(x, y);
        drawing = true;
      }
      context.setLineDash(style.dash);
      context.strokeStyle = colour;
      context.lineWidth = width;
      context.stroke();
    }
    context.setLineDash([]);
  }

  text(text, [x, y]) {
    this.context.lineWidth = 3;
    this.context.strokeStyle = "rgba(0,0,0,.8)";
    this.context.strokeText(text, x, y - 4);
    this.context.fillStyle = "#fff";
    this.context.fillText(text, x, y - 4);
  }

  legend(canvas, text) {
    const plane = this.colour || this.plane, limits = this.page && this.limits(plane, this.side);
    canvas.parentElement.hidden = !limits || (!this.colour && this.plane === "image");
    if (!limits) return;
    drawLegend(canvas, plane);
    const units = this.page.planes.find((each) => each.name === plane)?.units ?? "";
    text.textContent = `${plane} ${limits.low.toPrecision(4)} to ${limits.high.toPrecision(4)} ${units === "1" ? "" : units}`;
  }

  // Mouse and pen.
  wheel(event) {
    event.preventDefault();
    this.zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0016)), [event.offsetX, event.offsetY]);
  }
  down(event) {
    if (!this.page) return;
    this.canvas.setPointerCapture(event.pointerId);
    const at = [event.offsetX, event.offsetY];
    this.drag = { from: at, last: at, moved: false, kind: this.on.dragKind?.(this.pixelAt(at), at) ?? "move" };
    if (this.drag.kind !== "move") this.on.drag(this.drag.kind, this.pixelAt(at), [0, 0], true);
  }
  moved(event) {
    if (!this.page) return;
    const at = [event.offsetX, event.offsetY];
    if (this.drag) {
      const step = [0, 1].map((i) => (at[i] - this.drag.last[i]) / this.scale);
      this.drag.moved ||= Math.hypot(at[0] - this.drag.from[0], at[1] - this.drag.from[1]) > 3;
      if (this.drag.kind === "swipe") { this.swipe = Math.min(Math.max(at[0] / this.width, 0), 1); this.redraw(); }
      else if (this.drag.kind === "move") { if (this.drag.moved) this.look([0, 1].map((i) => this.centre[i] - step[i]), this.scale); }
      else this.on.drag(this.drag.kind, this.pixelAt(at), step, false);
      this.drag.last = at;
    }
    if (!this.drag || this.drag.kind === "move") this.on.hover(this.pixelAt(at));
  }
  up(event) {
    const drag = this.drag;
    this.drag = null;
    if (drag && !drag.moved && drag.kind === "move") this.on.click(this.pixelAt([event.offsetX, event.offsetY]));
  }
}
