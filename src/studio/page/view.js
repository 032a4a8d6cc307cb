// @ts-check
// The image: tone mapped by one shader, with exposure, false colours, error map, zoom, and a wipe between two pictures.

import {fromHalf} from './histogram.js';

/** @typedef {import('./server.js').Picture} Picture */

const kVertex = `#version 300 es
in vec2 corner;
void main() { gl_Position = vec4(corner, 0.0, 1.0); }`;

const kFragment = `#version 300 es
precision highp float;
uniform sampler2D first, second;
uniform vec2 canvas, origin, size;          // pixels of the canvas; the image's corner; its size there
uniform vec4 selected;                      // corner and size of the selected rectangle, in pixels of the image
uniform vec2 extent;                        // the image in its pixels
uniform float exposure, wipe, scaleFirst, scaleSecond;
uniform int mode;      // 0 image, 1 false colours; of two pictures: 2 relative, 3 signed, 4 squared difference
uniform int channel;   // 0 all, 1 red, 2 green, 3 blue, 4 luminance
uniform int tone;      // 0 sRGB, 1 ACES, 2 Reinhard
uniform float white;   // luminance that Reinhard maps to white, before the exposure
uniform bool hasMarks; // whether the selection and the wipe are drawn
uniform ivec2 grey;    // whether the pictures have one channel
uniform bool hasSecond;
out vec4 color;

float luminance(vec3 v) { return dot(v, vec3(0.2126, 0.7152, 0.0722)); }
vec3 value(sampler2D t, vec2 at, float scale, int isGrey) {
    vec3 v = texture(t, at).rgb * scale;
    if (isGrey != 0) return v.rrr;
    return channel == 0 ? v : vec3(channel == 4 ? luminance(v) : v[channel - 1]);
}
vec3 srgb(vec3 v) {
    v = clamp(v, 0.0, 1.0);
    return mix(12.92 * v, 1.055 * pow(v, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, v));
}
bool isBad(vec3 v) { return any(isnan(v)) || any(isinf(v)); }
// Black, blue, violet, orange, yellow, white.
vec3 heat(float x) {
    x = clamp(x, 0.0, 1.0) * 5.0;
    vec3 c[6] = vec3[6](vec3(0.0), vec3(0.1, 0.1, 0.6), vec3(0.6, 0.1, 0.6), vec3(1.0, 0.4, 0.1), vec3(1.0, 0.9, 0.2), vec3(1.0));
    int i = int(min(floor(x), 4.0));
    return mix(c[i], c[i + 1], x - float(i));
}
// As the command tonemap does.
vec3 toneMapped(vec3 v) {
    v *= exp2(exposure);
    if (tone == 1) {
        vec3 x = 0.6 * max(v, vec3(0.0));
        return (2.51 * x + 0.03) * x / ((2.43 * x + 0.59) * x + 0.14);
    }
    if (tone == 2) {
        float y = max(luminance(v), 0.0), w = max(white * exp2(exposure), 1e-20);
        return v * (1.0 + y / (w * w)) / (1.0 + y);
    }
    return v;
}
// Blue below zero, red above.
vec3 signedColor(float x) {
    x = clamp(x, -1.0, 1.0);
    return x > 0.0 ? vec3(x, 0.35 * x * x, 0.05 * x) : vec3(-0.1 * x, -0.5 * x, -x);
}
void main() {
    vec2 p = vec2(gl_FragCoord.x, canvas.y - gl_FragCoord.y);
    vec2 at = (p - origin) / size;
    if (any(lessThan(at, vec2(0.0))) || any(greaterThanEqual(at, vec2(1.0)))) { color = vec4(0.06, 0.065, 0.08, 1.0); return; }
    vec3 a = value(first, at, scaleFirst, grey.x);
    vec3 b = hasSecond ? value(second, at, scaleSecond, grey.y) : a;
    bool shows = !hasSecond || at.x < wipe;
    vec3 v = shows ? a : b;
    if (mode >= 2) {
        float relative = (luminance(a) - luminance(b)) / max(luminance(b), 1e-20), x = relative * exp2(exposure);
        vec3 c = mode == 3 ? signedColor(x) : heat(mode == 4 ? relative * x : abs(x));
        color = vec4(c, 1.0);
    } else if (mode == 1) {
        color = vec4(heat((log2(max(luminance(v), 1e-20)) + exposure + 8.0) / 10.0), 1.0);
    } else {
        color = vec4(srgb(toneMapped(v)), 1.0);
    }
    if (isBad(v) || (mode >= 2 && (isBad(a) || isBad(b)))) color = vec4(1.0, 0.0, 1.0, 1.0);
    if (!hasMarks) return;
    float scale = size.x / extent.x;
    if (hasSecond && mode < 2 && abs(at.x - wipe) * size.x < 1.0) color = vec4(1.0);
    vec2 d = abs((at * extent - selected.xy - 0.5 * selected.zw) * scale) - 0.5 * selected.zw * scale;
    float edge = max(d.x, d.y);
    if (edge > 0.0 && edge < 2.0) color = vec4(edge < 1.0 ? vec3(0.0) : vec3(1.0), 1.0);
}`;

/** @param {WebGL2RenderingContext} gl @param {string} vertex @param {string} fragment */
export function makeProgram(gl, vertex, fragment) {
    const program = /** @type {WebGLProgram} */ (gl.createProgram());
    for (const [type, text] of /** @type {[number, string][]} */ ([[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]])) {
        const shader = /** @type {WebGLShader} */ (gl.createShader(type));
        gl.shaderSource(shader, text);
        gl.compileShader(shader);
        if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader) ?? 'shader');
        gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program) ?? 'program');
    return program;
}

/**
 * Gives a canvas as many pixels as it covers; true where that changed it.
 * @param {HTMLCanvasElement} canvas
 */
export function fit(canvas) {
    const width = Math.max(1, Math.round(canvas.clientWidth * devicePixelRatio)),
        height = Math.max(1, Math.round(canvas.clientHeight * devicePixelRatio));
    if (canvas.width === width && canvas.height === height) return false;
    [canvas.width, canvas.height] = [width, height];
    return true;
}

/** @param {number} v @param {number} low @param {number} high */
export const clamp = (v, low, high) => Math.min(Math.max(v, low), high);

export class View {
    /** @param {HTMLCanvasElement} canvas @param {{pixel: () => void, wipe: (at: number) => void, trace: () => void}} tell */
    constructor(canvas, tell) {
        this.canvas = canvas;
        this.tell = tell;
        this.exposure = 0;
        this.mode = 0;
        this.tone = 0;
        this.channel = 0;
        /** Of the first picture: its largest luminance. */
        this.white = 1;
        this.wipe = 0.5;
        this.isFlipped = false;
        /** Of the image. */
        this.width = this.height = 1;
        this.zoom = 1;
        this.center = [0.5, 0.5];
        this.cursor = [0, 0];
        /** @type {number[] | null} The corner of the selected rectangle opposite to the cursor. */
        this.corner = null;
        /** @type {{picture: Picture, texture: WebGLTexture}[]} */
        this.pictures = [];
        this.isDue = false;
        const gl = canvas.getContext('webgl2', {antialias: false, preserveDrawingBuffer: true});
        this.gl = gl;
        this.hasGraphics = gl !== null;
        if (!gl) return;
        this.program = makeProgram(gl, kVertex, kFragment);
        gl.useProgram(this.program);
        gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
        gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 3, -1, -1, 3]), gl.STATIC_DRAW);
        const corner = gl.getAttribLocation(this.program, 'corner');
        gl.enableVertexAttribArray(corner);
        gl.vertexAttribPointer(corner, 2, gl.FLOAT, false, 0, 0);
        new ResizeObserver(() => this.redraw()).observe(canvas);
        this.listen();
    }

    /** @param {number} width @param {number} height */
    setSize(width, height) {
        if (this.width === width && this.height === height) return;
        [this.width, this.height] = [width, height];
        this.cursor = [width >> 1, height >> 1];
        this.corner = null;
        this.resetZoom();
    }

    /**
     * Shows a picture in one of two places; null empties it.
     * @param {0 | 1} place @param {Picture | null} picture
     */
    show(place, picture) {
        const gl = this.gl;
        if (!gl) return;
        if (!picture) {
            if (this.pictures[place]) gl.deleteTexture(this.pictures[place].texture);
            delete this.pictures[place];
            return this.redraw();
        }
        const texture = this.pictures[place]?.texture ?? /** @type {WebGLTexture} */ (gl.createTexture());
        gl.activeTexture(gl.TEXTURE0 + place);
        gl.bindTexture(gl.TEXTURE_2D, texture);
        gl.pixelStorei(gl.UNPACK_ALIGNMENT, 2);
        const [internal, format] = picture.channels === 1 ? [gl.R16F, gl.RED] : [gl.RGB16F, gl.RGB];
        gl.texImage2D(gl.TEXTURE_2D, 0, internal, picture.columns, picture.rows, 0, format, gl.HALF_FLOAT, picture.halves);
        gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
        gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
        this.pictures[place] = {picture, texture};
        this.redraw();
    }

    redraw() {
        if (this.isDue) return;
        this.isDue = true;
        requestAnimationFrame(() => { this.isDue = false; this.draw(); });
    }

    /** Pixels of the canvas for one of the image. */
    scale() {
        return this.zoom * Math.min(this.canvas.width / this.width, this.canvas.height / this.height);
    }
    /** The image's corner on the canvas. */
    origin() {
        const s = this.scale();
        return [this.canvas.width / 2 - this.center[0] * this.width * s, this.canvas.height / 2 - this.center[1] * this.height * s];
    }
    /**
     * The place in the image, from 0 to 1, under a point of the canvas element.
     * @param {number} x @param {number} y
     */
    place(x, y) {
        const s = this.scale(), [ox, oy] = this.origin();
        return [(x * devicePixelRatio - ox) / (s * this.width), (y * devicePixelRatio - oy) / (s * this.height)];
    }

    /**
     * The picture that is shown, in its own size and without marks.
     * @returns {Promise<Blob | null>}
     */
    png() {
        const {canvas, zoom, center} = this;
        [canvas.width, canvas.height] = [this.width, this.height];
        [this.zoom, this.center] = [1, [0.5, 0.5]];
        this.draw(false);
        const png = new Promise(done => canvas.toBlob(done, 'image/png'));
        [this.zoom, this.center] = [zoom, center];
        // The browser has copied the pixels.
        this.redraw();
        return /** @type {Promise<Blob | null>} */ (png);
    }

    draw(hasMarks = true) {
        const gl = this.gl;
        if (!gl || this.canvas.clientWidth === 0) return;
        if (hasMarks) fit(this.canvas);
        gl.viewport(0, 0, this.canvas.width, this.canvas.height);
        const [a, b] = this.isFlipped && this.pictures[1] ? [this.pictures[1], this.pictures[0]] : this.pictures;
        if (!a) {
            gl.clearColor(0.06, 0.065, 0.08, 1);
            gl.clear(gl.COLOR_BUFFER_BIT);
            return;
        }
        const s = this.scale();
        [a, b ?? a].forEach((p, i) => {
            gl.activeTexture(gl.TEXTURE0 + i);
            gl.bindTexture(gl.TEXTURE_2D, p.texture);
            const filter = s * this.width / p.picture.columns < 1 ? gl.LINEAR : gl.NEAREST;
            gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, filter);
            gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
        });
        const program = /** @type {WebGLProgram} */ (this.program);
        const at = (/** @type {string} */ name) => gl.getUniformLocation(program, name);
        gl.uniform1i(at('first'), 0);
        gl.uniform1i(at('second'), 1);
        gl.uniform2f(at('canvas'), this.canvas.width, this.canvas.height);
        gl.uniform2fv(at('origin'), this.origin());
        gl.uniform2f(at('size'), s * this.width, s * this.height);
        gl.uniform2f(at('extent'), this.width, this.height);
        const selected = this.selected();
        gl.uniform4f(at('selected'), selected.x, selected.y, selected.w, selected.h);
        gl.uniform1f(at('exposure'), this.exposure);
        gl.uniform1f(at('wipe'), this.wipe);
        gl.uniform1f(at('scaleFirst'), 2 ** a.picture.scale);
        gl.uniform1f(at('scaleSecond'), 2 ** (b ?? a).picture.scale);
        gl.uniform1i(at('mode'), this.mode);
        gl.uniform1i(at('tone'), this.tone);
        gl.uniform1i(at('channel'), this.channel);
        gl.uniform1f(at('white'), this.white);
        gl.uniform1i(at('hasMarks'), hasMarks ? 1 : 0);
        gl.uniform2i(at('grey'), a.picture.channels === 1 ? 1 : 0, (b ?? a).picture.channels === 1 ? 1 : 0);
        gl.uniform1i(at('hasSecond'), b ? 1 : 0);
        gl.drawArrays(gl.TRIANGLES, 0, 3);
    }

    resetZoom() {
        this.zoom = 1;
        this.center = [0.5, 0.5];
        this.redraw();
    }
    /**
     * Zooms so that a place of the image stays where it is.
     * @param {number} factor @param {number[]} about
     */
    zoomBy(factor, about) {
        const before = this.zoom;
        this.zoom = clamp(this.zoom * factor, 1, 256);
        const f = before / this.zoom;
        this.center = this.center.map((c, i) => clamp(about[i] + (c - about[i]) * f, 0, 1));
        this.redraw();
    }
    /** @param {number} x @param {number} y */
    moveCursor(x, y) {
        this.cursor = [clamp(x, 0, this.width - 1), clamp(y, 0, this.height - 1)];
        this.tell.pixel();
        this.redraw();
    }

    /**
     * The brightest pixel next to one, where pixels are too small to be hit.
     * @param {number[]} pixel
     */
    brightest([x, y]) {
        const picture = this.pictures[0]?.picture, kLarge = 4 * devicePixelRatio;
        if (!picture || picture.columns !== this.width || this.scale() >= kLarge) return [x, y];
        const luminance = (/** @type {number} */ px, /** @type {number} */ py) => {
            const at = picture.channels * (py * picture.columns + px), v = (/** @type {number} */ c) => fromHalf(picture.halves[at + c]);
            return picture.channels === 1 ? v(0) : 0.2126 * v(0) + 0.7152 * v(1) + 0.0722 * v(2);
        };
        let best = [x, y];
        for (let py = Math.max(0, y - 1); py <= Math.min(this.height - 1, y + 1); ++py)
            for (let px = Math.max(0, x - 1); px <= Math.min(this.width - 1, x + 1); ++px)
                if (luminance(px, py) > luminance(best[0], best[1])) best = [px, py];
        return best;
    }

    /** The pixel at the cursor, or the rectangle from the corner to it. */
    selected() {
        const [x, y] = this.cursor, [cx, cy] = this.corner ?? this.cursor;
        return {x: Math.min(x, cx), y: Math.min(y, cy), w: Math.abs(x - cx) + 1, h: Math.abs(y - cy) + 1};
    }

    listen() {
        const canvas = this.canvas;
        const pixelAt = (/** @type {PointerEvent} */ e) => {
            const [x, y] = this.place(e.offsetX, e.offsetY);
            return [clamp(Math.floor(x * this.width), 0, this.width - 1), clamp(Math.floor(y * this.height), 0, this.height - 1)];
        };
        /** @type {{kind: 'wipe' | 'pan' | 'select', x: number, y: number, moved: boolean} | null} */
        let drag = null;
        canvas.addEventListener('pointerdown', e => {
            canvas.setPointerCapture(e.pointerId);
            canvas.focus();
            const [x] = this.place(e.offsetX, e.offsetY);
            const distance = Math.abs(x - this.wipe) * this.scale() * this.width / devicePixelRatio;
            drag = {kind: e.shiftKey ? 'select' : this.pictures[1] && distance < 8 ? 'wipe' : 'pan', x: e.offsetX, y: e.offsetY, moved: false};
        });
        canvas.addEventListener('pointermove', e => {
            if (!drag) return;
            const dx = e.offsetX - drag.x, dy = e.offsetY - drag.y;
            if (!drag.moved && Math.hypot(dx, dy) < 3) return;
            if (drag.kind === 'select') {
                if (!drag.moved) this.corner = pixelAt(e);
                const [x, y] = pixelAt(e);
                this.moveCursor(x, y);
            } else if (drag.kind === 'wipe') {
                this.wipe = clamp(this.place(e.offsetX, e.offsetY)[0], 0, 1);
                this.tell.wipe(this.wipe);
            } else {
                const s = this.scale() / devicePixelRatio;
                this.center = [clamp(this.center[0] - dx / (s * this.width), 0, 1), clamp(this.center[1] - dy / (s * this.height), 0, 1)];
            }
            drag.moved = true;
            [drag.x, drag.y] = [e.offsetX, e.offsetY];
            this.redraw();
        });
        canvas.addEventListener('pointerup', e => {
            if (drag && !drag.moved) {
                const [x, y] = this.place(e.offsetX, e.offsetY);
                if (x >= 0 && y >= 0 && x < 1 && y < 1) {
                    this.corner = null;
                    const pixel = [Math.floor(x * this.width), Math.floor(y * this.height)], traces = e.ctrlKey || e.altKey;
                    const [px, py] = traces ? this.brightest(pixel) : pixel;
                    this.moveCursor(px, py);
                    if (traces) this.tell.trace();
                }
            }
            drag = null;
        });
        canvas.addEventListener('wheel', e => {
            e.preventDefault();
            this.zoomBy(Math.exp(-e.deltaY * 0.0022), this.place(e.offsetX, e.offsetY));
        }, {passive: false});
        canvas.addEventListener('keydown', e => {
            if (e.ctrlKey || e.altKey || e.metaKey) return;
            const step = e.shiftKey ? 10 : 1;
            const move = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1]}[e.key];
            const here = [(this.cursor[0] + 0.5) / this.width, (this.cursor[1] + 0.5) / this.height];
            if (move) this.moveCursor(this.cursor[0] + step * move[0], this.cursor[1] + step * move[1]);
            else if (e.key === 'z') this.zoomBy(1.5, here);
            else if (e.key === 'x') this.zoomBy(1 / 1.5, here);
            else if (e.key === '0') this.resetZoom();
            else if (e.key === 't') this.tell.trace();
            else if (e.key === 'r' || e.key === 'Escape') {
                this.corner = e.key === 'r' && !this.corner ? [...this.cursor] : null;
                this.moveCursor(this.cursor[0], this.cursor[1]);
            }
            else return;
            e.preventDefault();
        });
    }
}
