'use strict';

// The page shows two pieces of JSON: `report` with the results, and `pictures` with the images.
const report = JSON.parse(document.getElementById('report').textContent);
const pictures = JSON.parse(document.getElementById('pictures').textContent);

// ---------------------------------------------------------------------------------------- helpers

function element(name, properties = {}, children = []) {
    const e = document.createElement(name);
    for (const [key, value] of Object.entries(properties)) {
        if (key in e) e[key] = value;
        else e.setAttribute(key, value);
    }
    e.append(...[children].flat());
    return e;
}

const clamp = (v, low, high) => Math.min(Math.max(v, low), high);

function significant(v, digits = 3) {
    if (v === null || v === undefined || !Number.isFinite(v)) return '–';
    if (v === 0) return '0';
    const a = Math.abs(v);
    if (a >= 1e6 || a < 1e-4) return v.toExponential(digits - 1);
    return Number(v.toPrecision(digits)).toString();
}

function large(v) {
    for (const [unit, name] of [[1e9, ' G'], [1e6, ' M'], [1e3, ' k']])
        if (v >= unit) return significant(v / unit) + name;
    return significant(v);
}

const percent = v => significant(100 * v, 2) + ' %';

/// A row of buttons of which one is pressed; `choose` is called with its index.
function choice(names, chosen, choose) {
    const buttons = names.map((name, i) => element('button', {type: 'button', textContent: name}));
    const press = index => buttons.forEach(
        (b, i) => b.setAttribute('aria-pressed', String(i === index)));
    buttons.forEach((b, i) => b.addEventListener('click', () => { press(i); choose(i); }));
    press(chosen);
    return {element: element('span', {className: 'bar'}, buttons), press};
}

// ---------------------------------------------------------------------------------------- images

/// The value of each half float.
const halfValue = new Float32Array(65536);
for (let bits = 0; bits < 65536; ++bits) {
    const exponent = bits >> 10 & 31, fraction = bits & 1023;
    const magnitude = exponent === 31 ? (fraction ? NaN : Infinity)
        : exponent === 0 ? fraction * 2 ** -24 : (1 + fraction / 1024) * 2 ** (exponent - 15);
    halfValue[bits] = bits >> 15 ? -magnitude : magnitude;
}

async function decode(uri) {
    const image = new Image();
    image.src = uri;
    await image.decode();
    const canvas = element('canvas', {width: image.width, height: image.height});
    const context = canvas.getContext('2d', {willReadFrequently: true});
    context.drawImage(image, 0, 0);
    return context.getImageData(0, 0, image.width, image.height);
}

/// Radiance: half floats, high bytes in the upper half of the PNG and low bytes in the lower one.
async function decodeRadiance(uri) {
    const {width, height, data} = await decode(uri);
    const count = width * height / 2, codes = new Uint16Array(count * 3);
    for (let i = 0, to = 0; i < count; ++i)
        for (let c = 0; c < 3; ++c)
            codes[to++] = data[4 * i + c] << 8 | data[4 * (count + i) + c];
    return {width, height: height / 2, codes};
}

async function decodeGrey(uri) {
    const {data} = await decode(uri);
    const values = new Float32Array(data.length / 4);
    for (let i = 0; i < values.length; ++i) values[i] = data[4 * i] / 255;
    return values;
}

const grey = (codes, i) =>
    (halfValue[codes[3 * i]] + halfValue[codes[3 * i + 1]] + halfValue[codes[3 * i + 2]]) / 3;

function mean(picture) {
    let sum = 0;
    for (let i = 0; i < picture.width * picture.height; ++i) sum += grey(picture.codes, i);
    return sum / (picture.width * picture.height);
}

const toSrgb = v => v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055;
const operators = {
    sRGB: v => v,
    ACES: v => {
        const x = 0.6 * Math.max(v, 0);
        return x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14);
    },
};

/// Display code of every half float.
function toneTable(exposure, operator) {
    const table = new Uint8ClampedArray(65536), scale = 2 ** exposure;
    for (let bits = 0; bits < 65536; ++bits) {
        const v = halfValue[bits] * scale;
        table[bits] = v > 0 ? 255 * toSrgb(clamp(v === Infinity ? 1 : operators[operator](v), 0, 1)) : 0;
    }
    return table;
}

/// Ten colours of matplotlib's map "magma" (CC0), interpolated.
const magmaStops = [[0, 0, 4], [24, 15, 61], [68, 15, 118], [114, 31, 129], [158, 47, 127],
    [205, 64, 113], [241, 96, 93], [253, 150, 104], [254, 202, 141], [252, 253, 191]];
const magma = Array.from({length: 256}, (_, i) => {
    const x = i / 255 * 9, k = Math.min(Math.floor(x), 8), f = x - k;
    return [0, 1, 2].map(c => magmaStops[k][c] * (1 - f) + magmaStops[k + 1][c] * f);
});

function paint(width, height, colour) {
    const canvas = element('canvas', {width, height});
    const context = canvas.getContext('2d'), image = context.createImageData(width, height);
    for (let i = 0; i < width * height; ++i) {
        colour(i, image.data, 4 * i);
        image.data[4 * i + 3] = 255;
    }
    context.putImageData(image, 0, 0);
    return canvas;
}

function paintRadiance(picture, table) {
    const {codes} = picture;
    return paint(picture.width, picture.height, (i, out, at) => {
        const r = codes[3 * i], g = codes[3 * i + 1], b = codes[3 * i + 2];
        if (Number.isNaN(halfValue[r] + halfValue[g] + halfValue[b]) &&
            [r, g, b].some(v => Number.isNaN(halfValue[v]))) {
            out[at] = out[at + 2] = 255;
            return;
        }
        out[at] = table[r];
        out[at + 1] = table[g];
        out[at + 2] = table[b];
    });
}

function paintMap(picture, value) {
    return paint(picture.width, picture.height, (i, out, at) => {
        const v = value(i);
        const [r, g, b] = Number.isNaN(v) ? [255, 0, 255] : magma[Math.round(255 * clamp(v, 0, 1))];
        out[at] = r;
        out[at + 1] = g;
        out[at + 2] = b;
    });
}

/// What a pane can show of an image X; R is the reference, m the mean of R.
const displays = {
    'image': (p, view) => paintRadiance(p, view.table),
    // The term of relMSE.
    'relative squared error': (p, view) => {
        const floor = 0.01 * view.referenceMean ** 2, scale = 2 ** view.errorExposure;
        return paintMap(p, i => {
            const r = grey(view.reference.codes, i), d = grey(p.codes, i) - r;
            return scale * d * d / (r * r + floor);
        });
    },
    // Blue where X is too dark, red where it is too bright.
    'signed difference': (p, view) => {
        const scale = 2 ** view.errorExposure;
        return paint(p.width, p.height, (i, out, at) => {
            const r = grey(view.reference.codes, i);
            const v = clamp(scale * (grey(p.codes, i) - r) / (Math.abs(r) + 0.01 * view.referenceMean), -1, 1);
            out[at] = 255 * (v < 0 ? 1 + v : 1);
            out[at + 1] = 255 * (1 - Math.abs(v));
            out[at + 2] = 255 * (v > 0 ? 1 - v : 1);
        });
    },
    'FLIP': (p, view) => p.flip ? paintMap(p, i => p.flip[i]) : paintMap(p, () => 0),
};

// ---------------------------------------------------------------------------------------- viewer

const insetColours = ['#e69f00', '#56b4e9', '#cc79a7', '#009e73'];

/// Shows the images of one scene side by side, with a slider or one at a time, with common zoom, exposure and insets.
class Viewer {
    constructor(scene, figures) {
        this.pictures = scene;  // the reference first
        this.reference = scene[0];
        this.referenceMean = mean(this.reference);
        this.width = this.reference.width;
        this.height = this.reference.height;
        this.mode = 'slider';
        this.left = 0;
        this.right = Math.min(1, scene.length - 1);
        this.current = this.right;
        this.divider = 0.5;
        this.display = 'image';
        this.operator = 'sRGB';
        this.exposure = this.startExposure = figures.exposure;
        this.errorExposure = 0;
        this.zoom = 1;  // 1: the image fits
        this.center = [this.width / 2, this.height / 2];
        this.insets = this.chooseInsets();
        this.element = element('div', {className: 'viewer'});
        this.element.viewer = this;
        this.build();
        this.refresh();
        new ResizeObserver(() => this.draw()).observe(this.stage);
    }

    // -- Insets

    /// The squares with the largest relative squared errors.
    chooseInsets() {
        const size = Math.max(8, Math.round(Math.min(this.width, this.height) / 7));
        const columns = Math.max(1, Math.floor(this.width / size));
        const rows = Math.max(1, Math.floor(this.height / size));
        const tiles = [];
        for (let row = 0; row < rows; ++row)
            for (let column = 0; column < columns; ++column) {
                let error = 0;
                for (const p of this.pictures.slice(1)) error += this.tileError(p, column * size, row * size, size);
                tiles.push({x: column * size, y: row * size, size, error});
            }
        tiles.sort((a, b) => b.error - a.error);
        const far = (a, b) => Math.hypot(a.x - b.x, a.y - b.y) > 2.5 * size;
        const chosen = [tiles[0]];
        const second = tiles.find(t => far(t, tiles[0]));
        if (second) chosen.push(second);
        return chosen;
    }

    tileError(picture, x0, y0, size) {
        const floor = 0.01 * this.referenceMean ** 2;
        let sum = 0;
        for (let y = y0; y < Math.min(y0 + size, this.height); ++y)
            for (let x = x0; x < Math.min(x0 + size, this.width); ++x) {
                const i = y * this.width + x, r = grey(this.reference.codes, i);
                // The limit keeps single bright pixels from determining the choice.
                sum += Math.min(1, (grey(picture.codes, i) - r) ** 2 / (r * r + floor));
            }
        return sum;
    }

    addInset() {
        const size = this.insets.length ? this.insets[0].size : Math.round(this.width / 7);
        this.insets.push(this.inside({x: this.center[0] - size / 2, y: this.center[1] - size / 2, size}));
        this.buildInsets();
        this.draw();
    }

    inside(inset) {
        inset.x = clamp(inset.x, 0, Math.max(0, this.width - inset.size));
        inset.y = clamp(inset.y, 0, Math.max(0, this.height - inset.size));
        return inset;
    }

    resizeInsets(factor) {
        for (const inset of this.insets) {
            const size = clamp(inset.size * factor, 4, Math.min(this.width, this.height));
            inset.x += (inset.size - size) / 2;
            inset.y += (inset.size - size) / 2;
            inset.size = size;
            this.inside(inset);
        }
        this.draw();
    }

    // -- Controls

    build() {
        const modes = ['slider', 'flip', 'side by side'];
        const select = (options, chosen, change) => {
            const s = element('select', {}, options.map((o, i) => element('option', {textContent: o, value: i})));
            s.selectedIndex = chosen;
            s.addEventListener('change', () => change(s.selectedIndex));
            return s;
        };
        const names = this.pictures.map(p => p.name), kinds = Object.keys(displays);
        const modeBar = choice(modes, 0, i => { this.mode = modes[i]; this.buildStage(); this.draw(); });
        this.leftSelect = select(names, this.left, i => { this.left = i; this.draw(); });
        this.rightSelect = select(names, this.right, i => { this.right = i; this.draw(); });
        this.flipBar = choice(names, this.current, i => { this.show(i); });

        this.slider = element('input', {type: 'range', min: -10, max: 10, step: 0.25, value: this.exposure,
            className: 'exposure'});
        this.sliderText = element('output');
        this.slider.addEventListener('input', () => this.setExposure(Number(this.slider.value)));
        const step = by => () => this.setExposure(this.shownExposure() + by);

        this.pairControls = element('span', {className: 'bar'}, [
            element('label', {}, ['left', this.leftSelect]), element('label', {}, ['right', this.rightSelect])]);
        this.stage = element('div', {className: 'stage'});
        this.readout = element('div', {className: 'readout note'});
        this.insetGrid = element('div', {className: 'insets'});
        this.element.append(
            element('div', {className: 'bar'}, [modeBar.element, this.pairControls, this.flipBar.element]),
            element('div', {className: 'bar'}, [
                element('label', {}, ['show', select(kinds, 0, i => { this.display = kinds[i]; this.setExposure(this.shownExposure()); })]),
                element('label', {}, ['tone', select(Object.keys(operators), 0, i => { this.operator = Object.keys(operators)[i]; this.refresh(); })]),
                element('label', {}, ['exposure',
                    element('button', {type: 'button', textContent: '−', title: 'darker', onclick: step(-0.5)}),
                    this.slider,
                    element('button', {type: 'button', textContent: '+', title: 'brighter', onclick: step(0.5)}),
                    this.sliderText]),
                element('button', {type: 'button', textContent: 'reset view', onclick: () => this.reset()}),
                element('button', {type: 'button', textContent: 'add inset', onclick: () => this.addInset()}),
                element('button', {type: 'button', textContent: 'save figure', className: 'save', onclick: () => this.save()}),
            ]),
            this.stage, this.readout,
            element('p', {className: 'note', textContent: 'Wheel: zoom. Drag: pan, or move the divider or an inset. ' +
                'Wheel over a crop below: size of the insets. Keys 1 to 9: choose an image; space: back to the previous one.'}),
            element('div', {className: 'scroll'}, this.insetGrid));
        this.element.tabIndex = 0;
        this.element.addEventListener('keydown', event => this.onKey(event));
        this.buildStage();
        this.buildInsets();
        this.setExposure(this.exposure);
    }

    onKey(event) {
        if (event.target.matches('input, select, button')) return;
        const index = event.key === ' ' ? this.previous : Number(event.key) - 1;
        if (index === undefined || !this.pictures[index]) return;
        event.preventDefault();
        if (this.mode === 'slider') {
            this.right = this.rightSelect.selectedIndex = index;
            this.draw();
        } else {
            this.show(index);
        }
    }

    show(index) {
        this.previous = this.current;
        this.current = index;
        this.flipBar.press(index);
        this.draw();
    }

    shownExposure() { return this.display === 'image' ? this.exposure : this.errorExposure; }

    setExposure(value) {
        if (this.display === 'image') this.exposure = value;
        else this.errorExposure = value;
        this.slider.value = value;
        this.sliderText.textContent = `${value > 0 ? '+' : ''}${value} stops`;
        this.refresh();
    }

    reset() {
        this.zoom = 1;
        this.center = [this.width / 2, this.height / 2];
        this.divider = 0.5;
        this.errorExposure = 0;
        this.exposure = this.startExposure;
        this.setExposure(this.shownExposure());
    }

    /// One pane, or one per image in the mode 'side by side'.
    buildStage() {
        const count = this.mode === 'side by side' ? this.pictures.length : 1;
        this.pairControls.hidden = this.mode !== 'slider';
        this.pairControls.style.display = this.mode === 'slider' ? '' : 'none';
        this.flipBar.element.style.display = this.mode === 'flip' ? '' : 'none';
        const columns = count > 4 ? 3 : Math.min(count, 2);
        this.stage.style.gridTemplateColumns = `repeat(${columns}, 1fr)`;
        this.panes = [];
        for (let i = 0; i < count; ++i) {
            const canvas = element('canvas'), left = element('span', {className: 'name left'});
            const right = element('span', {className: 'name right'});
            const pane = element('div', {className: 'pane'}, [canvas, left, right]);
            pane.style.aspectRatio = `${this.width} / ${this.height}`;
            if (count === 1) pane.style.maxHeight = '82vh';
            this.panes.push({canvas, left, right, index: i});
            this.listen(this.panes[i]);
        }
        this.stage.replaceChildren(...this.panes.map(p => p.canvas.parentElement));
    }

    buildInsets() {
        this.insetGrid.style.gridTemplateColumns = `repeat(${this.pictures.length}, max-content)`;
        this.insetCanvases = [];
        const cells = this.pictures.map(p => element('div', {className: 'head', textContent: p.name}));
        this.insets.forEach((inset, k) => this.pictures.forEach((p, index) => {
            const canvas = element('canvas', {width: 300, height: 300});
            canvas.style.borderColor = insetColours[k % insetColours.length];
            this.dragInset(canvas, inset);
            this.insetCanvases.push({canvas, inset, index});
            cells.push(canvas);
        }));
        this.insetGrid.replaceChildren(...cells);
    }

    // -- Pointer

    /// Dragging a crop moves its inset.
    dragInset(canvas, inset) {
        canvas.addEventListener('pointerdown', down => {
            canvas.setPointerCapture(down.pointerId);
            let [x, y] = [down.clientX, down.clientY];
            canvas.onpointermove = event => {
                const scale = inset.size / canvas.clientWidth;
                inset.x -= (event.clientX - x) * scale;
                inset.y -= (event.clientY - y) * scale;
                [x, y] = [event.clientX, event.clientY];
                this.inside(inset);
                this.draw();
            };
            canvas.onpointerup = () => { canvas.onpointermove = null; };
        });
        canvas.addEventListener('wheel', event => {
            event.preventDefault();
            this.resizeInsets(2 ** (event.deltaY / 400));
        }, {passive: false});
    }

    /// Pixels of the page per pixel of the image.
    scale(canvas) {
        return this.zoom * Math.min(canvas.clientWidth / this.width, canvas.clientHeight / this.height);
    }
    toImage(canvas, event) {
        const box = canvas.getBoundingClientRect(), scale = this.scale(canvas);
        return [this.center[0] + (event.clientX - box.left - box.width / 2) / scale,
            this.center[1] + (event.clientY - box.top - box.height / 2) / scale];
    }

    /// The object that a press of the pointer would drag: an inset, the divider or the image.
    target(pane, event) {
        const box = pane.canvas.getBoundingClientRect();
        if (this.mode === 'slider' && Math.abs((event.clientX - box.left) - this.divider * box.width) < 8)
            return {kind: 'divider'};
        const [x, y] = this.toImage(pane.canvas, event);
        const inset = this.insets.findLast(i => x >= i.x && y >= i.y && x < i.x + i.size && y < i.y + i.size);
        return inset ? {kind: 'inset', inset} : {kind: 'image'};
    }

    listen(pane) {
        const {canvas} = pane;
        canvas.addEventListener('pointerdown', down => {
            canvas.setPointerCapture(down.pointerId);
            const held = this.target(pane, down);
            let last = down;
            canvas.onpointermove = event => {
                const box = canvas.getBoundingClientRect(), scale = this.scale(canvas);
                const dx = (event.clientX - last.clientX) / scale, dy = (event.clientY - last.clientY) / scale;
                last = event;
                if (held.kind === 'divider') {
                    this.divider = clamp((event.clientX - box.left) / box.width, 0, 1);
                } else if (held.kind === 'inset') {
                    held.inset.x += dx;
                    held.inset.y += dy;
                    this.inside(held.inset);
                } else {
                    this.moveTo(this.center[0] - dx, this.center[1] - dy);
                }
                this.draw();
            };
            canvas.onpointerup = () => { canvas.onpointermove = hover; };
        });
        const hover = event => {
            const {kind} = this.target(pane, event);
            canvas.className = kind === 'image' ? '' : `on-${kind}`;
            this.read(pane, event);
        };
        canvas.onpointermove = hover;
        canvas.addEventListener('pointerleave', () => { this.readout.textContent = ''; });
        canvas.addEventListener('dblclick', () => { this.zoom = 1; this.moveTo(this.width / 2, this.height / 2); this.draw(); });
        canvas.addEventListener('wheel', event => {
            event.preventDefault();
            const before = this.toImage(canvas, event);
            this.zoom = clamp(this.zoom * 2 ** (-event.deltaY / 300), 1, 64);
            const after = this.toImage(canvas, event);
            this.moveTo(this.center[0] + before[0] - after[0], this.center[1] + before[1] - after[1]);
            this.draw();
        }, {passive: false});
    }

    moveTo(x, y) {
        this.center = [clamp(x, 0, this.width), clamp(y, 0, this.height)];
    }

    read(pane, event) {
        const [x, y] = this.toImage(pane.canvas, event).map(Math.floor);
        if (x < 0 || y < 0 || x >= this.width || y >= this.height) {
            this.readout.textContent = '';
            return;
        }
        const i = y * this.width + x;
        this.readout.textContent = `pixel (${x}, ${y})   ` + this.pictures.map(p =>
            `${p.name}: ${[0, 1, 2].map(c => significant(halfValue[p.codes[3 * i + c]])).join(' ')}`).join('   ');
    }

    // -- Drawing

    /// Repaints all images after a change of exposure or display.
    refresh() {
        this.table = toneTable(this.exposure, this.operator);
        for (const p of this.pictures) p.painted = null;
        this.draw();
    }

    /// Draws at most once per frame.
    draw() {
        if (this.pending) return;
        this.pending = requestAnimationFrame(() => {
            this.pending = 0;
            for (const pane of this.panes) this.drawPane(pane);
            for (const i of this.insetCanvases) this.drawInset(i);
        });
    }

    painted(index) {
        const p = this.pictures[index];
        p.painted ??= displays[this.display](p, this);
        return p.painted;
    }

    drawPane(pane) {
        const {canvas} = pane, ratio = window.devicePixelRatio || 1;
        const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
        if (!width || !height) return;
        if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, {width, height});
        const context = canvas.getContext('2d'), scale = this.scale(canvas) * ratio;
        const place = () => context.setTransform(scale, 0, 0, scale,
            width / 2 - this.center[0] * scale, height / 2 - this.center[1] * scale);
        const image = (index, from, to) => {
            context.save();
            context.beginPath();
            context.rect(from, 0, to - from, height);
            context.clip();
            place();
            context.imageSmoothingEnabled = scale < 1;
            context.drawImage(this.painted(index), 0, 0);
            context.restore();
        };
        context.clearRect(0, 0, width, height);
        pane.left.textContent = pane.right.textContent = '';
        if (this.mode === 'slider') {
            const x = Math.round(this.divider * width);
            image(this.left, 0, x);
            image(this.right, x, width);
            context.fillStyle = '#fff';
            context.fillRect(x - ratio, 0, 2 * ratio, height);
            context.beginPath();
            context.arc(x, height / 2, 9 * ratio, 0, 2 * Math.PI);
            context.fill();
            pane.left.textContent = this.pictures[this.left].name;
            pane.right.textContent = this.pictures[this.right].name;
        } else {
            const index = this.mode === 'flip' ? this.current : pane.index;
            image(index, 0, width);
            pane.left.textContent = this.pictures[index].name;
        }
        pane.right.hidden = !pane.right.textContent;
        place();
        this.insets.forEach((inset, k) => {
            context.lineWidth = 2.5 * ratio / scale;
            context.strokeStyle = insetColours[k % insetColours.length];
            context.strokeRect(inset.x, inset.y, inset.size, inset.size);
        });
        context.setTransform(1, 0, 0, 1, 0, 0);
    }

    drawInset({canvas, inset, index}) {
        const context = canvas.getContext('2d');
        context.imageSmoothingEnabled = inset.size > canvas.width;
        context.clearRect(0, 0, canvas.width, canvas.height);
        context.drawImage(this.painted(index), inset.x, inset.y, inset.size, inset.size, 0, 0, canvas.width, canvas.height);
    }

    /// Downloads a figure for papers: the image with marked insets, and the crops beside it, as a PNG.
    save() {
        const pane = this.panes[0].canvas, crop = 200, gap = 6, head = 22;
        const rows = this.insets.length, columns = this.pictures.length;
        const height = Math.max(rows * (crop + gap) + head, 320);
        const left = Math.round(height * this.width / this.height);
        const canvas = element('canvas', {width: left + gap + columns * (crop + gap), height});
        const context = canvas.getContext('2d');
        context.fillStyle = '#fff';
        context.fillRect(0, 0, canvas.width, height);
        context.drawImage(pane, 0, 0, left, Math.round(left * pane.height / pane.width));
        context.fillStyle = '#000';
        context.font = '14px sans-serif';
        context.textAlign = 'center';
        for (const {canvas: c, inset, index} of this.insetCanvases) {
            const x = left + gap + index * (crop + gap), row = this.insets.indexOf(inset);
            if (row === 0) context.fillText(this.pictures[index].name, x + crop / 2, 15, crop);
            context.drawImage(c, x, head + row * (crop + gap), crop, crop);
            context.strokeStyle = insetColours[row % insetColours.length];
            context.lineWidth = 3;
            context.strokeRect(x + 1.5, head + row * (crop + gap) + 1.5, crop - 3, crop - 3);
        }
        download(canvas, `${this.sceneName}-insets.png`);
    }
}

function download(canvas, name) {
    element('a', {href: canvas.toDataURL('image/png'), download: name}).click();
}

// ---------------------------------------------------------------------------------------- sections

/// Columns of the table: name; value of a method; choice of the best value, format of the value, small text below it, and
/// condition for the mark of doubtful values.
const columns = [
    ['spp', m => m.summary.spp, {show: v => v ? large(v) : '–'}],
    ['rays', m => m.summary.rays, {show: v => v ? large(v) : '–'}],
    ['time', m => m.summary.seconds, {show: v => significant(v) + ' s'}],
    ['RMSE', m => m.summary.rmse, {best: Math.min}],
    ['relMSE', m => m.summary.rel_mse, {best: Math.min, small: m => m.summary.rel_mse_interval &&
        `± ${significant(m.summary.rel_mse_interval.high_95 - m.summary.rel_mse, 2)}`}],
    ['trimmed', m => m.summary.rel_mse_trimmed, {best: Math.min}],
    ['MAPE', m => m.summary.mape, {best: Math.min}],
    ['FLIP', m => m.flip, {best: Math.min}],
    ['mean ratio', m => m.summary.mean_ratio.value, {show: v => v.toFixed(4), doubtful: m =>
        (m.summary.mean_ratio.low_95 ?? 1) > 1 || (m.summary.mean_ratio.high_95 ?? 1) < 1,
        small: m => m.summary.mean_ratio.high_95 && `± ${significant(m.summary.mean_ratio.high_95 - m.summary.mean_ratio.value, 2)}`}],
    ['spike', m => m.summary.spike, {best: Math.min}],
    ['slope', m => m.summary.rel_mse_slope?.slope, {show: v => v?.toFixed(2) ?? '–',
        small: m => m.summary.rel_mse_slope_interval &&
            `± ${(m.summary.rel_mse_slope_interval.high_95 - m.summary.rel_mse_slope_interval.value).toFixed(2)}`}],
    ['memory', m => m.peak_bytes, {show: v => v ? significant(v / 2 ** 20) + ' MiB' : '–'}],
    ['efficiency', m => m.summary.efficiency?.value, {best: Math.max, show: v => v ? significant(v) + ' ×' : '–',
        small: m => m.summary.efficiency?.interval &&
            `${significant(m.summary.efficiency.interval.low_95, 2)} to ${significant(m.summary.efficiency.interval.high_95, 2)}`}],
];

function figuresTable(scene) {
    const head = element('tr', {}, [element('th', {textContent: 'method'}),
        ...columns.map(([name]) => element('th', {textContent: name}))]);
    const rows = scene.methods.map(m => element('tr', {}, [
        element('td', {}, [m.name, element('small', {textContent: m.estimator ?? 'images'})]),
        ...columns.map(([, get, {best, show = significant, small, doubtful}]) => {
            const value = get(m), cell = element('td', {textContent: show(value)});
            const all = scene.methods.map(get).filter(Number.isFinite);
            if (best && all.length > 1 && value === best(...all)) cell.className = 'best';
            if (doubtful?.(m)) cell.className = 'doubtful';
            const more = small?.(m);
            if (more) cell.append(element('small', {textContent: more}));
            return cell;
        })]));
    return element('div', {className: 'scroll'}, element('table', {className: 'figures'},
        [element('thead', {}, head), element('tbody', {}, rows)]));
}

function referenceNote(scene) {
    const r = scene.reference;
    const origin = r.method ? `${r.method}, ${large(r.spp)} spp in ${significant(r.seconds)} s${r.reused ? ' (kept from an earlier comparison)' : ''}`
        : `the file ${r.file}`;
    if (!r.variance_known)
        return element('p', {className: 'warning', textContent: `Reference: ${origin}. Its variance is unknown, so it ` +
            'is treated as exact: errors include its noise, and smaller errors cannot be measured.'});
    const shares = scene.methods.map(m => m.summary.reference_share).filter(Number.isFinite);
    const worst = Math.max(...shares);
    const text = `Reference: ${origin}. Its own relMSE is about ${significant(r.rel_mse, 2)}. The reference's noise is ` +
        `subtracted from MSE, RMSE and relMSE (at most ${percent(worst)} of relMSE), but MAPE, FLIP and spike include it.`;
    return element('p', {className: worst > 0.25 ? 'warning' : 'note', textContent: worst > 0.25
        ? `${text} This share is large: render the reference for longer.` : text});
}

function plotSection(page) {
    const image = element('img', {alt: 'error against time'});
    let current = 0;
    const show = i => {
        current = i;
        image.src = page.plots[i].svg;
    };
    const bar = choice(page.plots.map(p => p.label), 1, show);
    show(1);
    const save = element('button', {type: 'button', textContent: 'save PNG', onclick: () => {
        const canvas = element('canvas', {width: 1920, height: 1200});
        canvas.getContext('2d').drawImage(image, 0, 0, canvas.width, canvas.height);
        download(canvas, page.plots[current].file.replace('.svg', '.png'));
    }});
    const saveSvg = element('button', {type: 'button', textContent: 'save SVG', onclick: () =>
        element('a', {href: page.plots[current].svg, download: page.plots[current].file}).click()});
    return element('div', {className: 'plots'}, [element('h3', {textContent: 'Convergence'}),
        element('div', {className: 'bar'}, [bar.element, save, saveSvg]), image]);
}

/// Veach's pyramid: one row per path length, one column per s; merges and gathers are to the right of the other techniques.
async function pyramid(method, figures, viewer) {
    const state = {kind: 'weighted', exposure: viewer.startExposure}, cells = [];
    const lengths = [...new Set(method.techniques.map(t => t.edges))].sort((a, b) => a - b);
    const connections = Math.max(...method.techniques.filter(t => !t.kind).map(t => t.s), -1) + 1;
    const column = t => t.kind ? connections + t.s : t.s + 1;
    const columns = Math.max(...method.techniques.map(column));
    for (const t of method.techniques) {
        const canvas = element('canvas', {width: t.width, height: t.height});
        const cell = element('div', {}, [canvas, `${t.kind} s = ${t.s}, t = ${t.t}`]);
        cell.style.gridRow = lengths.indexOf(t.edges) + 1;
        cell.style.gridColumn = column(t);
        cells.push({cell, canvas, weighted: await decodeRadiance(t.weighted),
            unweighted: await decodeRadiance(t.unweighted)});
    }
    const draw = () => {
        const table = toneTable(state.exposure, 'sRGB');
        for (const c of cells)
            c.canvas.getContext('2d').drawImage(paintRadiance(c[state.kind], table), 0, 0);
    };
    const expose = by => () => { state.exposure += by; draw(); };
    draw();
    const bar = choice(['weighted', 'unweighted'], 0, i => { state.kind = ['weighted', 'unweighted'][i]; draw(); });
    bar.element.append('exposure', element('button', {type: 'button', textContent: '−', onclick: expose(-1)}),
        element('button', {type: 'button', textContent: '+', onclick: expose(1)}));
    const grid = element('div', {className: 'pyramid'}, cells.map(c => c.cell));
    grid.style.gridTemplateColumns = `repeat(${columns}, max-content)`;
    return element('details', {}, [
        element('summary', {textContent: `${method.name}, ${figures.technique_spp} spp`}), bar.element,
        element('div', {className: 'scroll'}, grid)]);
}

async function fillViewer(holder, scene, page) {
    const images = [{name: 'reference', ...await decodeRadiance(page.reference)}];
    for (const m of page.methods)
        images.push({name: m.name, ...await decodeRadiance(m.image), flip: await decodeGrey(m.flip)});
    const viewer = new Viewer(images, page);
    viewer.sceneName = page.name;
    holder.replaceChildren(element('h3', {textContent: 'Images'}), viewer.element);
    const withTechniques = page.methods.filter(m => m.techniques.length > 0);
    if (withTechniques.length === 0) return;
    holder.append(element('h3', {textContent: 'Contributions by technique'}), element('p', {className: 'note',
        textContent: 'One row per path length, one column per number s of light vertices. The weighted images sum to the ' +
            'image; an unweighted one is the estimate by this technique alone.'}));
    for (const m of withTechniques)
        holder.append(await pyramid(m, scene.methods.find(f => f.name === m.name), viewer));
}

function sceneSection(scene, page) {
    const holder = element('div', {}, element('p', {className: 'note', textContent: 'Images are decoded when they come into view.'}));
    new IntersectionObserver((entries, observer) => {
        if (!entries.some(e => e.isIntersecting)) return;
        observer.disconnect();
        fillViewer(holder, scene, page);
    }, {rootMargin: '600px'}).observe(holder);
    const section = element('section', {id: scene.name}, [
        element('h2', {textContent: scene.name}),
        element('p', {className: 'note', textContent: `${scene.file}, ${scene.width} × ${scene.height} pixels`})]);
    if (scene.interrupted)
        section.append(element('p', {className: 'warning', textContent: 'The comparison was interrupted, so the times of the methods differ.'}));
    section.append(...scene.failures.map(text => element('p', {className: 'warning', textContent: `${text}.`})));
    const warned = [['Reference', scene.reference], ...scene.methods.map(m => [m.name, m])];
    section.append(...warned.flatMap(([name, of]) => of.warnings.map(
        text => element('p', {className: 'warning', textContent: `${name}: ${text}.`}))));
    section.append(figuresTable(scene), referenceNote(scene), plotSection(page), holder);
    return section;
}

const legend = [
    ['rendering time', 'Wall-clock time of rendering. All methods use the same number of threads, in turns of a few seconds at most. Reading the scene and computing errors are not counted.'],
    ['RMSE, relMSE, MAPE', 'With X the image, R the reference, both grey, and m the mean of R: √mean (X − R)², mean (X − R)² / (R² + 0.01 m²), mean |X − R| / (R + 0.01 m). With several runs, means over them; ± is a 95 % interval.'],
    ['trimmed', 'relMSE without the 0.1 % of the pixels with the largest errors.'],
    ['FLIP', 'Mean of HDR-FLIP of the first run.'],
    ['mean ratio', 'Mean of X over mean of R with a 95 % interval, from the spread of the passes of X and of R. Marked where the interval does not contain 1. With the Sobol’ sampler the interval is too wide, since its passes are negatively correlated.'],
    ['spike', '99.99th percentile over the pixels of |X − R| / m.'],
    ['slope', 'Slope of log relMSE against log time, between 1/32 of the time and its end; −1 for an unbiased estimator with finite variance and independent samples. Plots show it as dashed lines.'],
    ['memory', 'Peak of the resident memory added by the method (film, buffers, maps). The scene, which all methods share, is not included.'],
    ['efficiency', '1 / (relMSE · time), relative to the first method.'],
];

const s = report.settings;
if (s) document.getElementById('settings').textContent =
    `${report.program}. Each method ${s.seconds ? `for ${s.seconds} s` : `with ${s.spp} samples per pixel`}, ` +
    `${s.runs === 1 ? 'one run' : `${s.runs} runs`} from seed ${s.seed}, sampler ${s.sampler}, ` +
    `${s.threads} threads of ${report.processor}.` +
    (s.paths === 'inner' ? ' Only paths that join two sub-paths inside the scene are shown and compared.' : '') +
    (s.shortest_path > 1 || s.longest_path
        ? ` Only paths of ${s.shortest_path} to ${s.longest_path ?? '∞'} edges are shown and compared.` : '');
document.getElementById('scenes').append(...report.failures.map(failure => element('p', {
    className: 'warning', textContent: `${failure.file} could not be compared: ${failure.reason}.`})));
document.getElementById('contents').append(...report.scenes.map(
    scene => element('a', {href: `#${scene.name}`, textContent: scene.name})));
document.getElementById('scenes').append(...report.scenes.map((scene, i) => sceneSection(scene, pictures[i])));
document.getElementById('legend').append(element('h3', {textContent: 'Definitions'}),
    element('dl', {}, legend.flatMap(([term, text]) =>
        [element('dt', {textContent: term}), element('dd', {textContent: text})])));
