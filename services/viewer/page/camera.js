// The picture of the camera, with the blobs and the mask of the background subtraction.

const BLOB = "#c026d3";

export class Camera {
  constructor(section) {
    this.section = section;
    this.canvas = section.querySelector("canvas");
    this.text = section.querySelector("p");
    this.showsMask = section.querySelector("input");
    this.showsMask.addEventListener("change", () => this.draw());
    this.motion = null;
    this.picture = this.mask = null;
  }

  clear() {
    this.picture = this.mask = this.motion = null;
  }

  /** A message: kind, bytes per pixel, 0, 0, width and height as u16, pixels. */
  take(view) {
    const [kind, channels] = [view.getUint8(0), view.getUint8(1)];
    const [width, height] = [view.getUint16(4, true), view.getUint16(6, true)];
    const pixels = new Uint8Array(view.buffer, 8);
    if (kind === 4) this.mask = { width, height, pixels };
    else this.picture = { width, height, channels, pixels };
    this.draw();
  }

  /** The camera in the scene: its state as a text, and its blobs as shares of the picture. */
  takeMotion(motion) {
    this.motion = motion;
    this.text.textContent = (motion?.state ?? "") + (this.picture ? "" : " (without pictures)");
    this.draw();
  }

  draw() {
    this.section.hidden = !this.picture && !this.motion;
    this.showsMask.parentElement.hidden = !this.mask;
    if (this.picture) this.drawPicture(this.picture);
    // Motion without a picture is drawn on an empty frame.
    else if (this.motion) [this.canvas.width, this.canvas.height] = [320, Math.max(1, Math.round(320 * this.motion.aspect))];
    this.drawBlobs();
  }

  drawPicture({ width, height, channels, pixels }) {
    const image = new ImageData(width, height);
    const fits = this.showsMask.checked && this.mask?.width === width && this.mask?.height === height;
    for (let index = 0; index < width * height; index++) {
      for (let channel = 0; channel < 3; channel++) image.data[4 * index + channel] = pixels[channels * index + (channels === 3 ? channel : 0)];
      if (fits && this.mask.pixels[index]) {
        image.data[4 * index] = (image.data[4 * index] + 255) / 2;
        image.data[4 * index + 1] /= 2;
      }
      image.data[4 * index + 3] = 255;
    }
    this.canvas.width = width;
    this.canvas.height = height;
    this.canvas.getContext("2d").putImageData(image, 0, 0);
  }

  drawBlobs() {
    const context = this.canvas.getContext("2d");
    const { width, height } = this.canvas;
    context.lineWidth = 2;
    context.strokeStyle = BLOB;
    for (const [left, top, right, bottom] of this.motion?.blobs ?? []) {
      context.strokeRect(left * width + 0.5, top * height + 0.5, (right - left) * width - 1, (bottom - top) * height - 1);
    }
  }
}
