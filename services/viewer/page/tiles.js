// The map: tiles of 32 × 32 cells, painted onto larger pieces that are quick to draw.

const EDGE = 32;
const CELLS = EDGE * EDGE;
const HEAD = 12;
/** Tiles along the edge of a piece. */
const PIECE = 8;

const UNKNOWN = [169, 173, 181];
const FREE = [250, 250, 250];
const WALL = [22, 25, 31];
const REMOVED = [217, 45, 32];
const ADDED = [31, 111, 235];

export class Tiles {
  constructor() {
    this.clear();
    this.mode = "filtered";
  }

  clear() {
    this.layers = [new Map(), new Map()];
    this.pieces = new Map();
    this.bounds = null;
    this.known = 0;
  }

  /** Takes a message with tiles: layer, column, row and a signed byte for each cell, row by row from the smallest y. */
  take(view) {
    for (let at = 4; at + HEAD + CELLS <= view.byteLength; at += HEAD + CELLS) {
      const [layer, column, row] = [view.getUint32(at, true), view.getInt32(at + 4, true), view.getInt32(at + 8, true)];
      const key = `${column},${row}`;
      this.layers[layer]?.set(key, new Int8Array(view.buffer, at + HEAD, CELLS).slice());
      this.widen(column, row);
      this.paint(column, row);
    }
    this.known = this.layers[0].size;
  }

  /** "filtered", "unfiltered" or "difference". */
  show(mode) {
    this.mode = mode;
    this.pieces.clear();
    const keys = new Set([...this.layers[0].keys(), ...this.layers[1].keys()]);
    for (const key of keys) this.paint(...key.split(",").map(Number));
  }

  widen(column, row) {
    const b = this.bounds ?? { left: column, right: column + 1, bottom: row, top: row + 1 };
    this.bounds = {
      left: Math.min(b.left, column), right: Math.max(b.right, column + 1),
      bottom: Math.min(b.bottom, row), top: Math.max(b.top, row + 1),
    };
  }

  paint(column, row) {
    const key = `${column},${row}`;
    const [filtered, unfiltered] = [this.layers[0].get(key), this.layers[1].get(key)];
    const colour = { filtered: () => shade, unfiltered: () => (_, other) => shade(other), difference: () => difference }[this.mode]();
    const [pieceColumn, pieceRow] = [Math.floor(column / PIECE), Math.floor(row / PIECE)];
    const piece = this.piece(pieceColumn, pieceRow);
    const image = new ImageData(EDGE, EDGE);
    for (let index = 0; index < CELLS; index++) {
      // The first row of the picture has the largest y.
      const pixel = 4 * ((EDGE - 1 - Math.floor(index / EDGE)) * EDGE + (index % EDGE));
      image.data.set(colour(filtered?.[index] ?? 0, unfiltered?.[index] ?? 0), pixel);
      image.data[pixel + 3] = 255;
    }
    const x = (column - pieceColumn * PIECE) * EDGE;
    const y = (PIECE - 1 - (row - pieceRow * PIECE)) * EDGE;
    piece.canvas.getContext("2d").putImageData(image, x, y);
  }

  piece(column, row) {
    const key = `${column},${row}`;
    let piece = this.pieces.get(key);
    if (!piece) {
      const canvas = document.createElement("canvas");
      canvas.width = canvas.height = PIECE * EDGE;
      piece = { canvas, column, row };
      this.pieces.set(key, piece);
    }
    return piece;
  }

  /** Draws the map; `toScreen(x, y)` takes metres. */
  draw(context, toScreen, cell) {
    context.imageSmoothingEnabled = false;
    const edge = PIECE * EDGE * cell;
    const { width, height } = context.canvas;
    for (const { canvas, column, row } of this.pieces.values()) {
      const [left, top] = toScreen(column * edge, (row + 1) * edge).map(Math.round);
      const [right, bottom] = toScreen((column + 1) * edge, row * edge).map(Math.round);
      if (right < 0 || bottom < 0 || left > width || top > height) continue;
      context.drawImage(canvas, left, top, right - left, bottom - top);
    }
  }
}

function shade(value) {
  const target = value > 0 ? WALL : FREE;
  const share = Math.min(1, Math.abs(value) / 96);
  return UNKNOWN.map((from, channel) => from + (target[channel] - from) * share);
}

/** Colours the cells that only one of the two maps has as occupied. */
function difference(filtered, unfiltered) {
  const wall = (value) => value > 40;
  if (wall(unfiltered) && !wall(filtered)) return REMOVED;
  if (wall(filtered) && !wall(unfiltered)) return ADDED;
  if (filtered === 0) return UNKNOWN;
  return shade(filtered).map((channel) => channel + (235 - channel) * 0.45);
}
