// Play, pause and speed: shows the state of playback and sends commands to it.

export class ReplayControls {
  constructor(section, send) {
    this.section = section;
    this.pause = section.querySelector("#pause");
    this.speed = section.querySelector("#speed");
    this.progress = section.querySelector("#progress");
    this.state = { paused: false, times: 1 };
    this.pause.addEventListener("click", () => send({ paused: !this.state.paused, times: this.state.times ?? 1 }));
    this.speed.addEventListener("change", () => send({ paused: this.state.paused, times: Number(this.speed.value) }));
  }

  show(replay) {
    this.section.hidden = !replay;
    if (!replay) return;
    this.state = replay;
    this.pause.textContent = replay.paused ? "play" : "pause";
    this.progress.value = replay.done;
    this.section.querySelector("#pace").hidden = replay.times === null;
    if (replay.times === null || document.activeElement === this.speed) return;
    const value = String(replay.times);
    if (![...this.speed.options].some((option) => option.value === value)) this.speed.add(new Option(`× ${value}`, value));
    this.speed.value = value;
  }
}
