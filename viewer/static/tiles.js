// Tiles of planes: fetched once, kept up to a limit, painted when a stretch asks for it.
import { backend } from "./api.js";

const LIMIT = 160;

export class Tiles {
  constructor(arrived) { this.arrived = arrived; this.kept = new Map(); this.faults = new Map(); }

  static size(page, level) { return page.size_px.map((side) => Math.ceil(side / 2 ** level)); }
  static count(page, level) { return Tiles.size(page, level).map((side) => Math.ceil(side / page.tile_px)); }
  static key(page, side, plane, level, column, row) { return [side, page.product, page.version ?? 0, plane, level, column, row].join("/"); }

  // Width and height of a tile.
  static shape(page, level, column, row) {
    return Tiles.size(page, level).map((size, i) => Math.min(page.tile_px, size - [column, row][i] * page.tile_px));
  }

  // The tile if it is there; else null, and it is requested unless `ask` is false.
  get(page, side, plane, level, column, row, ask = true) {
    const key = Tiles.key(page, side, plane, level, column, row), found = this.kept.get(key);
    if (found) {
      this.kept.delete(key);
      this.kept.set(key, found);
      return found.values ? found : null;
    }
    if (ask) this.ask(page, side, [plane], level, column, row);
    return null;
  }

  // Ask for a tile of each plane that is not there, all in one request.
  async ask(page, side, planes, level, column, row) {
    const [width, height] = Tiles.shape(page, level, column, row);
    const missing = planes.filter((plane) => !this.kept.has(Tiles.key(page, side, plane, level, column, row)));
    if (!missing.length) return;
    const entries = missing.map((plane) => this.keep(Tiles.key(page, side, plane, level, column, row), { width, height, values: null }));
    const coming = backend.tiles(page.product, missing, level, column, row, side).then((found) => found.forEach((values, i) => {
      if (values.length !== width * height) throw new Error(`a tile of ${missing[i]} has ${values.length} values`);
      entries[i].values = values;
    })).catch((error) => { for (const plane of missing) this.faults.set(`${page.product}/${plane}`, error.message); });
    for (const entry of entries) entry.coming = coming;
    await coming;
    for (const plane of missing) this.arrived(plane);
  }

  keep(key, entry) {
    this.kept.set(key, entry);
    while (this.kept.size > LIMIT) this.kept.delete(this.kept.keys().next().value);
    return entry;
  }

  // All tiles of a level, as they came with the page.
  put(page, side, { plane, level }, values) {
    const [columns, rows] = Tiles.count(page, level);
    let at = 0;
    for (let row = 0; row < rows; row++) for (let column = 0; column < columns; column++) {
      const [width, height] = Tiles.shape(page, level, column, row), key = Tiles.key(page, side, plane, level, column, row);
      if (!this.kept.get(key)?.values) this.keep(key, { width, height, values: values.subarray(at, at + width * height) });
      at += width * height;
    }
  }

  // Tiles of some planes, to be waited for.
  async wait(page, side, planes, level, column, row) {
    await this.ask(page, side, planes, level, column, row);
    await Promise.all(planes.map((plane) => this.kept.get(Tiles.key(page, side, plane, level, column, row))?.coming));
  }

  // The value of a plane at a pixel; undefined where its tile is not there yet.
  value(page, side, plane, x, y) {
    const column = Math.floor(x / page.tile_px), row = Math.floor(y / page.tile_px);
    const found = this.kept.get(Tiles.key(page, side, plane, 0, column, row));
    return found?.values?.[(y - row * page.tile_px) * found.width + (x - column * page.tile_px)];
  }
}
