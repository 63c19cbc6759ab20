// The table of images: only the rows in sight are there, pages come from the backend.
import { backend } from "./api.js";

const ROW_PX = 26, PAGE = 100;
const WIDTHS = { product: 134, status: 68, reason: 260, camera: 130, utc: 150, note: 180, review: 74 };
const SHOWN = ["product", "status", "sigma_px", "limb_rms_px", "review", "reason", "offset_px", "camera", "phase_deg", "radius_px", "utc"];
const HEADINGS = { sigma_px: "σ, px", limb_rms_px: "limb rms, px", offset_px: "offset, px", phase_deg: "phase", radius_px: "radius, px", status: "verdict", range_factor: "range x" };
const ENDS = { sigma_px: [0.001, 10], limb_rms_px: [0.01, 10] };  // of the sparklines' logarithmic scale, px

export class Table {
  constructor(elements, on) {
    Object.assign(this, elements, { on, criteria: { text: "", sort: "", down: false }, pages: new Map(), total: 0, selected: null, wanted: 0 });
    this.columns = [];
    this.table.addEventListener("scroll", () => this.draw());
    new ResizeObserver(() => this.draw()).observe(this.table);
  }

  setColumns(columns) {
    this.known = columns;
    let kept = null;
    try { kept = JSON.parse(localStorage.getItem("planetpose-columns")); } catch { /* none */ }
    const names = (kept ?? SHOWN).filter((name) => columns.some((column) => column.name === name));
    this.columns = names.map((name) => columns.find((column) => column.name === name));
    this.drawHead();
    this.draw();
  }

  toggle(name, shown) {
    const column = this.known.find((each) => each.name === name);
    this.columns = shown ? [...this.columns, column] : this.columns.filter((each) => each !== column);
    localStorage.setItem("planetpose-columns", JSON.stringify(this.columns.map((each) => each.name)));
    this.drawHead();
    this.draw();
  }

  drawHead() {
    this.head.replaceChildren(...this.columns.map((column) => {
      const cell = document.createElement("div"), button = document.createElement("button");
      cell.className = "cell";
      cell.role = "columnheader";
      cell.style.width = `${this.width(column) / 14}em`;
      const sorted = this.criteria.sort === column.name;
      cell.ariaSort = sorted ? (this.criteria.down ? "descending" : "ascending") : "none";
      button.textContent = `${HEADINGS[column.name] ?? column.name}${sorted ? (this.criteria.down ? " ▼" : " ▲") : ""}`;
      button.title = `Sort by ${column.name}`;
      button.addEventListener("click", () => {
        const down = sorted ? !this.criteria.down : column.kind === "number";
        this.ask({ ...this.criteria, sort: column.name, down });
      });
      cell.append(button);
      return cell;
    }));
  }

  // px at letters of 14 px
  width(column) { return WIDTHS[column.name] ?? (column.kind === "text" ? 110 : column.name in ENDS ? 116 : 88); }

  // Another filter or order. Throws what is wrong with it.
  async ask(criteria) {
    const number = ++this.wanted, page = await backend.rows(criteria, 0, PAGE);
    if (number !== this.wanted) return;
    this.criteria = criteria;
    this.pages = new Map([[0, page.rows]]);
    this.take(page);
    this.table.scrollTop = 0;
    this.drawHead();
    this.draw();
  }

  take(page) {
    this.total = page.fitting;
    this.body.style.height = `${page.fitting * ROW_PX}px`;
    this.table.ariaRowCount = page.fitting;
    this.on.counted(page);
  }

  async reload() {
    this.pages.clear();
    await this.fetch(Math.floor(Math.max(this.table.scrollTop, 0) / ROW_PX / PAGE));
  }

  async fetch(number) {
    if (this.pages.has(number)) return this.pages.get(number);
    const criteria = this.criteria;
    this.pages.set(number, null);
    const page = await backend.rows(criteria, number * PAGE, PAGE);
    if (criteria !== this.criteria) return [];
    if (this.pages.size > 40) this.pages.clear();
    this.pages.set(number, page.rows);
    this.take(page);
    this.draw();
    return page.rows;
  }

  async rowAt(place) {
    if (place < 0 || place >= this.total) return null;
    const number = Math.floor(place / PAGE), rows = this.pages.get(number) ?? (await backend.rows(this.criteria, number * PAGE, PAGE)).rows;
    this.pages.set(number, rows);
    return rows[place - number * PAGE] ?? null;
  }

  select(place, product) {
    Object.assign(this, { place, selected: product });
    if (place === null) return this.draw();
    const top = place * ROW_PX, height = this.table.clientHeight - ROW_PX - this.head.clientHeight;
    if (top < this.table.scrollTop) this.table.scrollTop = top;
    else if (top > this.table.scrollTop + height) this.table.scrollTop = top - height;
    this.draw();
  }

  replace(row) {
    for (const rows of this.pages.values()) {
      const at = rows?.findIndex((each) => each.product === row.product) ?? -1;
      if (at >= 0) rows[at] = row;
    }
    this.draw();
  }

  draw() {
    const first = Math.max(Math.floor(this.table.scrollTop / ROW_PX) - 4, 0);
    const last = Math.min(first + Math.ceil(this.table.clientHeight / ROW_PX) + 8, this.total);
    const drawn = [];
    for (let place = first; place < last; place++) {
      const rows = this.pages.get(Math.floor(place / PAGE));
      if (rows === undefined) this.fetch(Math.floor(place / PAGE)).catch((error) => this.on.fault(error));
      drawn.push(this.row(rows?.[place % PAGE], place));
    }
    this.rows.style.top = `${first * ROW_PX}px`;
    this.rows.replaceChildren(...drawn);
  }

  row(content, place) {
    const row = document.createElement("div");
    row.className = "row";
    row.role = "row";
    row.ariaRowIndex = place + 1;
    row.ariaSelected = String(Boolean(content) && content.product === this.selected);
    row.append(...this.columns.map((column) => this.cell(column, content)));
    if (content) row.addEventListener("click", () => this.on.chosen(content.product, place));
    return row;
  }

  cell(column, content) {
    const cell = document.createElement("div"), value = content?.[column.name];
    cell.className = `cell ${column.kind}`;
    cell.role = "gridcell";
    cell.style.width = `${this.width(column) / 14}em`;
    if (value === null || value === undefined) return cell;
    const series = content.neighbours?.[column.name];
    if (series && value > 0) cell.append(sparkline(series, value, ENDS[column.name]));
    cell.append(shown(value, column));
    cell.title = series ? `${value}; beside it the images of this camera before and after` : String(value);
    if (["status", "review"].includes(column.name)) cell.classList.add(value || "none");
    return cell;
  }
}

export function shown(value, column) {
  if (column.kind === "number") return Number.isInteger(value) ? String(value) : Math.abs(value) >= 1e5 ? value.toExponential(2) : column.name in ENDS ? value.toPrecision(3) : value.toPrecision(4);
  return column.kind === "time" ? String(value).slice(0, 19).replace("T", " ") : String(value);
}

// The values of the images that the same camera took before and after this one, logarithmic; this one is the dot,
// orange in the upper third of the scale.
function sparkline(values, own, [low, high]) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg"), make = (name, attributes) => {
    const element = document.createElementNS(svg.namespaceURI, name);
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
    svg.append(element);
  };
  for (const [name, size] of [["width", 54], ["height", 20]]) svg.setAttribute(name, size);
  svg.setAttribute("aria-hidden", "true");
  const share = (value) => Math.min(Math.max(Math.log(value / low) / Math.log(high / low), 0), 1);
  const at = (value, i) => [3 + (48 * i) / (values.length - 1), 17 - 14 * share(value)];
  let path = "", drawing = false;
  values.forEach((value, i) => {
    if (!(value > 0)) { drawing = false; return; }
    path += `${drawing ? "L" : "M"}${at(value, i).map((each) => each.toFixed(1)).join(" ")}`;
    drawing = true;
  });
  make("path", { d: path || "M0 0", fill: "none", stroke: "#8795a3", "stroke-width": 1 });
  const [x, y] = at(own, (values.length - 1) / 2);
  make("circle", { cx: x, cy: y, r: 2.6, fill: share(own) > 0.67 ? "#e69f00" : "#56b4e9" });
  svg.style.cssFloat = "left";
  svg.style.marginTop = "1px";
  return svg;
}
