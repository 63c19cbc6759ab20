// Where the page's data come from: the server, or files beside the page (planetpose view --export).
import { openingIn, tilesIn } from "./answers.js";
import { makeFilter } from "./filter.js";

const metaOf = (name) => document.querySelector(`meta[name="planetpose-${name}"]`).content;
const token = metaOf("token"), folder = metaOf("data");

async function answerOf(response) {
  if (response.ok && !response.headers.has("x-planetpose-fault")) return response;
  const text = await response.text();
  let fault = text;
  try { fault = JSON.parse(text).fault ?? text; } catch { /* plain text */ }
  throw new Error(fault || response.statusText);
}
const get = async (path) => answerOf(await fetch(path, { credentials: "same-origin" }));
const getJson = async (path) => (await get(path)).json();
const query = (values) => new URLSearchParams(values).toString();
const named = encodeURIComponent;

class Server {
  about() { return getJson("api/store"); }
  rows(criteria, first, count) { return getJson(`api/table?${query({ ...criteria, first, count })}`); }
  async place(product, criteria) { return (await getJson(`api/place?${query({ product, ...criteria })}`)).place; }
  points(x, y, text) { return getJson(`api/points?${query({ x, y, text })}`); }
  product(name, side = 0) { return getJson(`api/products/${named(name)}?side=${side}`); }
  // The page, and the tiles of a plane at the level that is drawn first.
  async opening(name, plane) {
    return openingIn(await (await get(`api/products/${named(name)}/opening?${query({ plane })}`)).arrayBuffer());
  }
  // A tile of each of the planes, in one answer.
  async tiles(name, planes, level, column, row, side = 0) {
    const path = `api/products/${named(name)}/tiles/${planes.join()}/${level}/${column}/${row}?side=${side}`;
    return tilesIn(await (await get(path)).arrayBuffer(), planes.length);
  }
  at(name, x, y) { return getJson(`api/products/${named(name)}/at?${query({ x, y })}`); }
  flow(name) { return getJson(`api/products/${named(name)}/flow`); }
  find(name, place) { return getJson(`api/products/${named(name)}/find?${query({ place })}`); }
  smallPicture(name) { return `api/products/${named(name)}/small.png`; }  // no picture where there is none
  async post(path, content) {
    const headers = { "content-type": "application/json", "x-planetpose-token": token };
    const response = await fetch(path, { method: "POST", headers, body: JSON.stringify(content ?? {}) });
    return (await answerOf(response)).json();
  }
  decide(name, made) { return this.post(`api/products/${named(name)}/decisions`, made); }
  undo(name) { return this.post(`api/products/${named(name)}/undo`); }
  redo(name) { return this.post(`api/products/${named(name)}/redo`); }
  job(number) { return getJson(`api/jobs/${number}`); }
  refresh() { return this.post("api/refresh"); }
}

class Files {
  constructor(base) { this.base = base; this.orders = new Map(); }
  async about() {
    const content = await getJson(`${this.base}/table.json`);
    this.names = content.columns.map((column) => column.name);
    this.table = content.rows.map((row) => Object.fromEntries(row.map((value, i) => [this.names[i], value])));
    this.pictured = new Set(content.pictured);
    this.addNeighbours();
    this.kinds = Object.fromEntries(content.columns.map((column) => [column.name, column.kind]));
    return { ...content, rows: undefined, pictured: undefined, images: this.table.length, read_only: true };
  }
  // As viewer/table.py has them.
  addNeighbours(names = ["sigma_px", "limb_rms_px"], beside = 4) {
    const key = (row) => `${row.camera}\n${row.utc}`, sorted = [...this.table].sort((a, b) => (key(a) < key(b) ? -1 : 1));
    sorted.forEach((row, at) => {
      const near = Array.from({ length: 2 * beside + 1 }, (_, i) => sorted[at + i - beside]);
      row.neighbours = Object.fromEntries(names.map((name) => [name, near.map((each) => (each?.camera === row.camera ? each[name] : null))]));
    });
  }
  order({ text = "", sort = "", down = false }) {
    const key = JSON.stringify([text, sort, down]);
    if (!this.orders.has(key)) {
      const fits = makeFilter(text, this.kinds);
      const chosen = this.table.filter(fits);
      const unknown = (row) => row[sort] === null || row[sort] === "";
      const sign = down ? -1 : 1;
      if (sort) chosen.sort((a, b) => unknown(a) - unknown(b) || (a[sort] < b[sort] ? -sign : a[sort] > b[sort] ? sign : 0));
      this.orders.set(key, chosen);
    }
    return this.orders.get(key);
  }
  async rows(criteria, first, count) {
    const order = this.order(criteria), counts = {};
    for (const row of order) counts[row.status] = (counts[row.status] ?? 0) + 1;
    return { rows: order.slice(first, first + count), fitting: order.length, images: this.table.length, counts };
  }
  async place(product, criteria) {
    const found = this.order(criteria).findIndex((row) => row.product === product);
    return found < 0 ? null : found;
  }
  async points(x, y, text) {
    const value = (row, name) => name === "utc" ? (row.utc ? 1970 + Date.parse(row.utc) / 31557600e3 : null) : row[name];
    const chosen = this.order({ text }).filter((row) => Number.isFinite(value(row, x)) && Number.isFinite(value(row, y)));
    const list = (name) => chosen.map((row) => value(row, name));
    return { x: list(x), y: list(y), product: list("product"), status: list("status"), camera: list("camera"), every: 1 };
  }
  product(name) { return getJson(`${this.base}/products/${named(name)}/page.json`); }
  async opening(name) { return { page: await this.product(name), values: null }; }
  tiles(name, planes, level, column, row) { return Promise.all(planes.map((plane) => this.tile(name, plane, level, column, row))); }
  async tile(name, plane, level, column, row) {
    const response = await get(`${this.base}/products/${named(name)}/${plane}/${level}-${column}-${row}.bin.gz`);
    const stream = response.body.pipeThrough(new DecompressionStream("gzip"));
    return new Float32Array(await new Response(stream).arrayBuffer());
  }
  smallPicture(name) { return this.pictured.has(name) ? `${this.base}/products/${named(name)}/small.png` : null; }
  async refresh() { return {}; }
}

export const backend = folder.startsWith("@") || !folder ? new Server() : new Files(folder);
export const isStatic = backend instanceof Files;
