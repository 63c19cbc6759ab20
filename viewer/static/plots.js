// A plot of two columns, linked to the table; and the contact sheet.
import { backend } from "./api.js";

const MARKS = { ok: ["#3fcf9f", "o"], doubtful: ["#f0ab1a", "+"] }, OTHERS = ["#ff9a78", "x"], EDGE = 54;

export class Plot {
  constructor(elements, on) {
    Object.assign(this, elements, { on, points: null, selected: null });
    for (const select of [this.x, this.y]) select.addEventListener("change", () => this.load(this.text));
    this.canvas.addEventListener("click", (event) => this.clicked(event));
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  setColumns(columns) {
    const names = columns.filter((column) => column.kind !== "text").map((column) => column.name);
    for (const [select, chosen] of [[this.x, "utc"], [this.y, "offset_px"]]) {
      select.replaceChildren(...names.map((name) => new Option(name, name, false, name === chosen)));
    }
  }

  async load(text) {
    this.text = text;
    this.points = await backend.points(this.x.value, this.y.value, text);
    const each = this.points.every > 1 ? `, every ${this.points.every}th` : "";
    this.count.textContent = `${this.points.x.length} images${each}`;
    this.draw();
  }

  place() {
    const ends = (values) => {
      let low = Infinity, high = -Infinity;
      for (const value of values) { if (value < low) low = value; if (value > high) high = value; }
      const margin = (high - low) * 0.04 || 1;
      return [low - margin, high + margin];
    };
    const [x0, x1] = ends(this.points.x), [y0, y1] = ends(this.points.y), { clientWidth: w, clientHeight: h } = this.canvas;
    return { x0, x1, y0, y1, x: (v) => EDGE + ((v - x0) / (x1 - x0)) * (w - EDGE - 10), y: (v) => h - 30 - ((v - y0) / (y1 - y0)) * (h - 42) };
  }

  draw() {
    const { canvas } = this, ratio = window.devicePixelRatio || 1, context = canvas.getContext("2d");
    canvas.width = canvas.clientWidth * ratio;
    canvas.height = canvas.clientHeight * ratio;
    context.scale(ratio, ratio);
    if (!this.points?.x.length) return;
    const at = this.place();
    context.fillStyle = context.strokeStyle = "#b4bfca";
    context.font = "12px system-ui";
    context.lineWidth = 1;
    context.strokeRect(EDGE, 12, canvas.clientWidth - EDGE - 10, canvas.clientHeight - 42);
    for (let i = 0; i <= 4; i++) {
      const [x, y] = [at.x0 + (i / 4) * (at.x1 - at.x0), at.y0 + (i / 4) * (at.y1 - at.y0)];
      context.textAlign = i === 4 ? "right" : i ? "center" : "left";
      context.fillText(Number(x.toPrecision(6)), at.x(x), canvas.clientHeight - 12);
      context.textAlign = "right";
      context.fillText(Number(y.toPrecision(3)), EDGE - 4, at.y(y) + 4);
    }
    context.lineWidth = 1.4;
    this.points.x.forEach((value, i) => this.mark(context, at.x(value), at.y(this.points.y[i]), this.points.status[i], this.points.product[i] === this.selected));
  }

  mark(context, x, y, status, chosen) {
    const [colour, kind] = MARKS[status] ?? OTHERS, size = chosen ? 8 : 3;
    context.strokeStyle = chosen ? "#f0e442" : colour;
    context.beginPath();
    if (kind === "o") context.arc(x, y, size, 0, 7);
    else if (kind === "+") { context.moveTo(x - size, y); context.lineTo(x + size, y); context.moveTo(x, y - size); context.lineTo(x, y + size); }
    else { context.moveTo(x - size, y - size); context.lineTo(x + size, y + size); context.moveTo(x - size, y + size); context.lineTo(x + size, y - size); }
    context.stroke();
  }

  clicked(event) {
    if (!this.points?.x.length) return;
    const at = this.place();
    let best = 0, nearest = Infinity;
    this.points.x.forEach((value, i) => {
      const away = Math.hypot(at.x(value) - event.offsetX, at.y(this.points.y[i]) - event.offsetY);
      if (away < nearest) [best, nearest] = [i, away];
    });
    this.on.chosen(this.points.product[best]);
  }
}

const SHEET = 60;

// Small pictures of the images that fit, more as one scrolls.
export class Sheet {
  constructor(element, on) {
    Object.assign(this, { element, on, criteria: null, first: 0, total: 0 });
    element.addEventListener("scroll", () => {
      if (element.scrollTop + element.clientHeight > element.scrollHeight - 300) this.more();
    });
  }

  async load(criteria) {
    Object.assign(this, { criteria, first: 0, total: Infinity, loading: false });
    this.element.replaceChildren();
    await this.more();
  }

  async more() {
    if (this.loading || this.first >= this.total) return;
    this.loading = true;
    const page = await backend.rows(this.criteria, this.first, SHEET);
    this.total = page.fitting;
    this.element.append(...page.rows.map((row, i) => this.button(row, this.first + i)));
    this.first += page.rows.length;
    this.loading = false;
  }

  button(row, place) {
    const button = document.createElement("button"), label = document.createElement("span"), source = backend.smallPicture(row.product);
    button.append(source ? this.picture(source) : missing(), label);
    label.textContent = `${row.status === "ok" ? "" : `${row.status}: `}${row.product}`;
    label.className = row.status;
    if (row.reason) {
      const code = document.createElement("span");
      code.className = "why";
      code.textContent = row.reason.split(": ")[0];
      button.append(code);
    }
    button.title = row.reason ?? row.product;
    button.addEventListener("click", () => this.on.chosen(row.product, place));
    return button;
  }

  picture(source) {
    const image = new Image(104, 104);
    image.loading = "lazy";
    image.alt = "";
    image.addEventListener("error", () => image.replaceWith(missing()));
    image.src = source;
    return image;
  }
}

function missing() {
  return Object.assign(document.createElement("div"), { className: "missing", textContent: "no picture" });
}
