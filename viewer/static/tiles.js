// Tiles of planes: fetched once, kept up to a limit, painted when a stretch asks for it.
import { backend } from "./api.js";

const LIMIT = 160;

export class Tiles {
  constructor(arrived) { this.arrived = arrived; this.kept = new Map(); this.faults = new Map(); }

  static size(page, level) { return page.size_px.map((side) => Math.ceil(side / 2 ** level)); }

  // The tile if it is there; else null, and it is asked for.
  get(page, side, plane, level, column, row) {
    const key = [side, page.product, page.version ?? 0, plane, level, column, row].join("/");
    const found = this.kept.get(key);
    if (found) {
      this.kept.delete(key);
      this.kept.set(key, found);
      return found.values ? found : null;
    }
    this.ask(key, page, side, plane, level, column, row);
    return null;
  }

  async ask(key, page, side, plane, level, column, row) {
    const [width, height] = Tiles.size(page, level).map((size, i) => Math.min(page.tile_px, size - [column, row][i] * page.tile_px));
    const entry = { width, height, values: null, drawn: new Map() };
    this.kept.set(key, entry);
    while (this.kept.size > LIMIT) this.kept.delete(this.kept.keys().next().value);
    entry.coming = backend.tile(page.product, plane, level, column, row, side).then((values) => {
      if (values.length !== width * height) throw new Error(`a tile of ${plane} has ${values.length} values`);
      entry.values = values;
      this.arrived(plane);
    }).catch((error) => { this.faults.set(`${page.product}/${plane}`, error.message); this.arrived(plane); });
    return entry.coming;
  }

  // The same, to be waited for; null where it cannot be had.
  async wait(page, side, plane, level, column, row) {
    const key = [side, page.product, page.version ?? 0, plane, level, column, row].join("/");
    if (!this.kept.has(key)) await this.ask(key, page, side, plane, level, column, row);
    const entry = this.kept.get(key);
    await entry?.coming;
    return entry?.values ? entry : null;
  }

  // The value of a plane at a pixel; undefined where its tile is not there yet (and is asked for).
  value(page, side, plane, x, y, ask = true) {
    const column = Math.floor(x / page.tile_px), row = Math.floor(y / page.tile_px);
    const key = [side, page.product, page.version ?? 0, plane, 0, column, row].join("/");
    const found = this.kept.get(key);
    if (!found) { if (ask) this.ask(key, page, side, plane, 0, column, row); return undefined; }
    if (!found.values) return undefined;
    return found.values[(y - row * page.tile_px) * found.width + (x - column * page.tile_px)];
  }
}
