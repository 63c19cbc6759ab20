// Values under the mouse, clicked places with sigmas, distances; all can be copied as CSV.
import { backend, isStatic } from "./api.js";

const PLANES = ["image", "latitude", "longitude", "incidence", "emission", "phase", "latitude_uncertainty", "longitude_uncertainty", "quality"];
const COLUMNS = ["product", "x_px", "y_px", "value", "latitude_deg", "longitude_deg", "incidence_deg", "emission_deg", "phase_deg", "range_km", "remark"];
const SIGMAS = ["latitude_deg", "longitude_deg", "x_px", "y_px"];

// A failed image has no coordinates.
const planesOf = (page) => PLANES.filter((name) => page.planes.some((each) => each.name === name));

export class Hover {
  constructor(elements, picture) {
    Object.assign(this, elements, { picture, pins: [], at: null });
  }

  // The tiles that hovering needs, requested before the mouse comes.
  async prepare(page) {
    const column = Math.floor(page.centre_px?.[0] / page.tile_px) || 0, row = Math.floor(page.centre_px?.[1] / page.tile_px) || 0;
    const inside = [column, row].every((place, i) => place >= 0 && place * page.tile_px < page.size_px[i]);
    if (this.picture.page !== page) return;
    const place = inside ? [column, row] : [0, 0];
    await this.picture.tiles.wait(page, this.picture.side, planesOf(page), 0, ...place);
  }

  values(x, y) {
    const { page, side, tiles } = this.picture, [nx, ny] = page.size_px;
    if (x < 0 || y < 0 || x >= nx || y >= ny) return null;
    const chosen = [this.picture.plane, this.picture.colour].filter((plane) => plane && !PLANES.includes(plane));
    const planes = [...planesOf(page), ...chosen];
    const place = [Math.floor(x / page.tile_px), Math.floor(y / page.tile_px)];
    tiles.ask(page, side, planesOf(page), 0, ...place);
    for (const plane of chosen) tiles.ask(page, side, [plane], 0, ...place);
    return Object.fromEntries(planes.map((plane) => [plane, tiles.value(page, side, plane, x, y)]));
  }

  move(place) {
    this.at = place;
    const { page } = this.picture;
    if (!page || !place) { this.output.textContent = ""; return; }
    const x = Math.round(place[0]), y = Math.round(place[1]), values = this.values(x, y);
    if (!values) { this.output.textContent = `(${place[0].toFixed(1)}, ${place[1].toFixed(1)}) px: outside of the frame`; return; }
    const parts = [`<b>(${x + page.first_px[0]}, ${y + page.first_px[1]})</b> px`, `value <b>${number(values.image, 5)}</b>`];
    if (Number.isFinite(values.latitude)) {
      const sigma = (name) => Number.isFinite(values[name]) ? ` ± ${values[name].toPrecision(2)}` : "";
      parts.push(`latitude <b>${Math.abs(values.latitude).toFixed(3)} ${values.latitude < 0 ? "S" : "N"}</b>${sigma("latitude_uncertainty")}`);
      parts.push(`longitude <b>${number(values.longitude, 6)} E</b>${sigma("longitude_uncertainty")}`);
      for (const name of ["incidence", "emission", "phase"]) parts.push(`${name} <b>${number(values[name], 5)}</b>`);
      if (values.incidence >= 90) parts.push("night side");
    } else parts.push(page.failed ? "no coordinates: no pose is confirmed" : values.latitude === undefined ? "…" : "off the body");
    for (const name of Object.keys(values).filter((each) => !PLANES.includes(each))) parts.push(`${name} <b>${number(values[name], 5)}</b>`);
    const flags = page.flags.filter((flag) => values.quality & flag.mask).map((flag) => flag.name);
    parts.push(`<span class="quiet">flags: ${flags.join(", ") || "none"}</span>`);
    this.output.innerHTML = parts.join(" &nbsp; ");
  }

  async pin(place) {
    const { page } = this.picture;
    let found;
    if (isStatic || page.failed) {
      const [x, y] = place.map(Math.round), values = this.values(x, y) ?? {};
      found = { product: page.product, x_px: x, y_px: y, value: values.image, latitude_deg: values.latitude, longitude_deg: values.longitude, incidence_deg: values.incidence, emission_deg: values.emission, phase_deg: values.phase, remark: page.failed ? "no pose is confirmed" : "", sigmas: { latitude_deg: values.latitude_uncertainty, longitude_deg: values.longitude_uncertainty } };
    } else found = await backend.at(page.product, place[0] + page.first_px[0], place[1] + page.first_px[1]);
    this.add(found);
  }

  add(found) {
    this.pins = [...this.pins.slice(-199), found];
    this.head.innerHTML = `<tr>${COLUMNS.map((name) => `<th>${name}</th>`).join("")}</tr>`;
    const row = document.createElement("tr");
    for (const name of COLUMNS) {
      const cell = document.createElement("td"), sigma = found.sigmas?.[name];
      cell.textContent = (typeof found[name] === "number" ? number(found[name], 7) : found[name] ?? "") + (Number.isFinite(sigma) ? ` ± ${sigma.toPrecision(2)}` : "");
      row.append(cell);
    }
    this.body.prepend(row);
    while (this.body.rows.length > 8) this.body.lastChild.remove();
  }

  csv() {
    const quoted = (value) => /[",\n]/.test(value) ? `"${value.replaceAll('"', '""')}"` : value;
    const lines = this.pins.map((pin) => [...COLUMNS.map((name) => pin[name]), ...SIGMAS.map((name) => pin.sigmas?.[name])]);
    return [[...COLUMNS, ...SIGMAS.map((name) => `${name}_sigma`)], ...lines].map((line) => line.map((value) => quoted(String(value ?? ""))).join(",")).join("\n") + "\n";
  }

  // Pixels and, where both ends are on the body, kilometres along its surface (on its mean sphere).
  distance([from, to]) {
    const pixels = Math.hypot(to[0] - from[0], to[1] - from[1]), { page } = this.picture;
    const ends = [from, to].map(([x, y]) => this.values(Math.round(x), Math.round(y)));
    let text = `${pixels.toFixed(2)} px`;
    if (!page.failed && ends.some((end) => end && end.latitude === undefined)) return `${text}, …`;
    if (ends.every((end) => end && Number.isFinite(end.latitude))) {
      const [a, b] = ends.map((end) => [end.latitude, end.longitude].map((angle) => (angle * Math.PI) / 180));
      const half = Math.sin((b[0] - a[0]) / 2) ** 2 + Math.cos(a[0]) * Math.cos(b[0]) * Math.sin((b[1] - a[1]) / 2) ** 2;
      const angle = 2 * Math.asin(Math.min(Math.sqrt(half), 1)), radius = page.radii_km.reduce((sum, each) => sum + each, 0) / 3;
      text += `, ${((angle * 180) / Math.PI).toFixed(3)} deg, ${(angle * radius).toFixed(2)} km on the surface`;
    } else text += `, ${((pixels * page.range_km) / page.focal_length_px).toFixed(2)} km at the target's distance`;
    return text;
  }
}

function number(value, digits) {
  if (value === undefined) return "…";
  return Number.isFinite(value) ? String(Number(value.toPrecision(digits))) : "unknown";
}
