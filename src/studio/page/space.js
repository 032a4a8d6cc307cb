// @ts-check
// The scene in three dimensions, with light paths. Rays are traced by the program, on the true geometry.

import {clamp, fit, makeProgram} from './view.js';
import {element, significant} from './controls.js';

/** @typedef {[number, number, number]} Vec */

const kMeshVertex = `#version 300 es
layout(location = 0) in vec3 position;
layout(location = 1) in vec4 row0;
layout(location = 2) in vec4 row1;
layout(location = 3) in vec4 row2;
uniform mat4 transform;
uniform vec3 low, extent;
out vec3 world;
void main() {
    vec4 p = vec4(low + position * extent, 1.0);
    world = vec3(dot(row0, p), dot(row1, p), dot(row2, p));
    gl_Position = transform * vec4(world, 1.0);
}`;

const kMeshFragment = `#version 300 es
precision highp float;
in vec3 world;
uniform vec3 eye, tint;
uniform float isLit;
out vec4 color;
void main() {
    vec3 n = normalize(cross(dFdx(world), dFdy(world)));
    float facing = abs(dot(n, normalize(eye - world)));
    vec3 v = mix(tint * (0.25 + 0.75 * facing), tint, isLit);
    color = vec4(pow(clamp(v, 0.0, 1.0), vec3(1.0 / 2.2)), 1.0);
}`;

const kLineVertex = `#version 300 es
in vec3 position;
in vec4 tint;
uniform mat4 transform;
uniform float pointSize;
out vec4 shade;
void main() { gl_Position = transform * vec4(position, 1.0); gl_PointSize = pointSize; shade = tint; }`;

const kLineFragment = `#version 300 es
precision highp float;
in vec4 shade;
uniform float fade;
out vec4 color;
void main() { color = vec4(shade.rgb, shade.a * fade); }`;

const add = (/** @type {Vec} */ a, /** @type {Vec} */ b, f = 1) => /** @type {Vec} */ (a.map((v, i) => v + f * b[i]));
const dot = (/** @type {Vec} */ a, /** @type {Vec} */ b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (/** @type {Vec} */ a, /** @type {Vec} */ b) => /** @type {Vec} */ ([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]);
const unit = (/** @type {Vec} */ v) => /** @type {Vec} */ (v.map(c => c / Math.hypot(...v)));

/**
 * Product of two matrices, by columns.
 * @param {number[]} a @param {number[]} b
 */
function product(a, b) {
    return Array.from({length: 16}, (_, i) => [0, 1, 2, 3].reduce((sum, k) => sum + a[4 * k + i % 4] * b[4 * (i >> 2) + k], 0));
}

/**
 * The outline of a cone: its rim at distance `length` from the apex, and four lines to it.
 * @param {Vec} apex @param {Vec} toward @param {number} degrees Half-angle.
 * @returns {Vec[][]} Lines.
 */
export function coneOutline(apex, toward, degrees) {
    const along = add(toward, apex, -1), length = Math.hypot(...along), axis = unit(along);
    const side = unit(cross(axis, Math.abs(axis[0]) < 0.7 ? [1, 0, 0] : [0, 1, 0])), other = cross(axis, side);
    const c = length * Math.cos(degrees * Math.PI / 180), s = length * Math.sin(degrees * Math.PI / 180), kCorners = 32;
    const rim = Array.from({length: kCorners + 1}, (_, i) => {
        const phi = 2 * Math.PI * i / kCorners;
        return add(add(add(apex, axis, c), side, s * Math.cos(phi)), other, s * Math.sin(phi));
    });
    return [rim, ...[0, 1, 2, 3].map(i => [apex, rim[i * kCorners / 4]])];
}

/**
 * The axis of the scene that is closest to the upward direction of the camera.
 * @param {Vec} up
 */
function upAxis(up) {
    const i = [0, 1, 2].reduce((best, c) => Math.abs(up[c]) > Math.abs(up[best]) ? c : best, 1);
    return {index: i, sign: up[i] < 0 ? -1 : 1};
}

/** @param {any} scene */
const cameraOf = scene => ({eye: /** @type {Vec} */ (scene.eye), look: /** @type {Vec} */ (scene.look), center: /** @type {Vec} */ (scene.center), up: upAxis(scene.up)});

/**
 * Keys of walking, by their places on the keyboard, and the directions: to the right, up, forward.
 * @type {Record<string, Vec>}
 */
const kSteps = {KeyW: [0, 0, 1], KeyS: [0, 0, -1], KeyA: [-1, 0, 0], KeyD: [1, 0, 0], KeyE: [0, 1, 0], KeyR: [0, 1, 0], KeyQ: [0, -1, 0], KeyF: [0, -1, 0]};
/** Radii of the scene in a second, at first. */
const kWalkingSpeed = 0.4;

/**
 * A line through points, drawn as one color.
 * @typedef {{points: Vec[], color: number[], width?: number, marks?: boolean, chosen?: number}} Line
 */

export class Space {
    /**
     * @param {HTMLCanvasElement} canvas @param {HTMLElement} toolbar @param {HTMLElement} label
     * @param {import('./server.js').Server} server @param {any} scene
     */
    constructor(canvas, toolbar, label, server, scene) {
        this.canvas = canvas;
        this.label = label;
        this.server = server;
        this.radius = scene.radius;
        this.home = cameraOf(scene);
        /** What the view turns about. @type {Vec} */
        this.target = this.home.center;
        /** Of the target from the eye. @type {number} */
        this.distance = scene.radius;
        /** Whether the view walks: it turns about the eye, and keys move it. */
        this.isWalking = false;
        /** Radii of the scene in a second. */
        this.speed = kWalkingSpeed;
        /** Keys of walking that are pressed. @type {Set<string>} */
        this.pressed = new Set();
        this.runs = false;
        this.lastStep = 0;
        /** The crosshair, from -1 to 1. */
        this.cross = [0, 0];
        this.cut = 0;
        /** @type {Record<string, Line[]>} By who draws them. */
        this.lines = {};
        /** @type {any[]} */
        this.shapes = [];
        this.isDue = false;
        /** Whether the view moves: until the timer ends. @type {ReturnType<typeof setTimeout> | undefined} */
        this.moving = undefined;
        /** Time in ms that the graphics processor needs for all triangles. */
        this.fullTime = 0;
        this.isMeasured = false;
        /** Triangles of the last picture. */
        this.drawnTriangles = 0;
        /**
         * Called with a point under the pointer.
         * @type {{click: (x: number, y: number) => void, drag: (x: number, y: number) => boolean, press: (x: number, y: number) => boolean, release: () => void,
         *         render: (camera: {eye: Vec, target: Vec, up: Vec} | null) => void, say: (text: string) => void}}
         */
        this.tell = {click: () => {}, drag: () => false, press: () => false, release: () => {}, render: () => {}, say: () => {}};
        this.cutInput = element('input', {type: 'range', id: 'cut', min: 0, max: 1, step: 0.005, value: 0, oninput: () => { this.cut = Number(this.cutInput.value); this.redraw(); }});
        this.walkButton = element('button', {type: 'button', id: 'walk', textContent: 'Walk', 'aria-pressed': 'false',
            title: 'Drag to look around; W A S D to go, E and Q or R and F to rise and sink, with Shift faster; the wheel changes the speed', onclick: () => { this.walk(!this.isWalking); canvas.focus(); }});
        toolbar.append(
            this.walkButton,
            element('button', {type: 'button', textContent: 'Camera', title: 'Look as the camera does', onclick: () => this.lookAsCamera()}),
            element('button', {type: 'button', textContent: 'From outside', title: 'Look from outside the scene', onclick: () => this.lookFromOutside()}),
            element('button', {type: 'button', id: 'render-view', textContent: 'Render this view', title: 'Put the camera of the scene here, and render', onclick: () => this.tell.render({eye: this.eye(), target: add(this.eye(), this.forward(), this.radius), up: this.vertical()})}),
            element('label', {title: 'Leave out what is nearer than this'}, ['cut away ', this.cutInput]));
        this.lookAsCamera();
        const gl = canvas.getContext('webgl2', {antialias: true, preserveDrawingBuffer: true});
        this.gl = gl;
        if (!gl) return;
        this.meshProgram = makeProgram(gl, kMeshVertex, kMeshFragment);
        this.lineProgram = makeProgram(gl, kLineVertex, kLineFragment);
        this.lineBuffer = gl.createBuffer();
        new ResizeObserver(() => this.redraw()).observe(canvas);
        this.listen();
    }

    /** @param {any} scene Another version, as the program describes it. */
    setScene(scene) {
        this.radius = scene.radius;
        this.home = cameraOf(scene);
    }

    lookAsCamera() {
        const {eye, look, center} = this.home;
        this.distance = clamp(dot(add(center, eye, -1), look), 0.05 * this.radius, 4 * this.radius);
        this.target = add(eye, look, this.distance);
        this.setDirection(look);
    }
    lookFromOutside() {
        this.target = this.home.center;
        this.distance = 2.6 * this.radius;
        this.redraw();
    }
    /**
     * Looks from a point to the centre of the scene; turning the view then turns it about the point.
     * @param {Vec} point
     */
    lookFrom(point) {
        this.target = point;
        this.distance = 1e-3 * this.radius;
        this.cut = 0;
        this.cutInput.value = 0;
        this.setDirection(unit(add(this.home.center, point, -1)));
    }
    vertical() {
        const {index, sign} = this.home.up;
        return /** @type {Vec} */ ([0, 1, 2].map(c => c === index ? sign : 0));
    }
    /** Indices of the horizontal axes, such that x, the vertical and z are a right-handed frame. */
    horizontal() {
        const {index, sign} = this.home.up, x = (index + 2) % 3, z = (index + 1) % 3;
        return sign > 0 ? [x, z] : [z, x];
    }
    /** @param {Vec} d */
    setDirection(d) {
        const [x, z] = this.horizontal();
        this.azimuth = Math.atan2(d[x], d[z]);
        this.height = Math.asin(clamp(dot(d, this.vertical()), -1, 1));
        this.redraw();
    }
    forward() {
        const c = Math.cos(this.height ?? 0), a = this.azimuth ?? 0, [x, z] = this.horizontal();
        const d = /** @type {Vec} */ (this.vertical().map(v => v * Math.sin(this.height ?? 0)));
        d[x] = c * Math.sin(a);
        d[z] = c * Math.cos(a);
        return d;
    }
    frame() {
        const forward = this.forward(), right = unit(cross(forward, this.vertical()));
        return {forward, right, up: cross(right, forward)};
    }
    eye() { return add(this.target, this.forward(), -this.distance); }
    near() { return 2e-3 * this.radius + this.cut * 2 * (this.distance + this.radius); }

    matrix() {
        const {forward, right, up} = this.frame(), eye = this.eye();
        const f = 1 / Math.tan(0.4), aspect = this.canvas.width / this.canvas.height;
        const near = this.near(), far = near + 8 * this.radius + this.distance;
        const view = [right[0], up[0], -forward[0], 0, right[1], up[1], -forward[1], 0, right[2], up[2], -forward[2], 0,
            -dot(right, eye), -dot(up, eye), dot(forward, eye), 1];
        const perspective = [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, 2 * far * near / (near - far), 0];
        return product(perspective, view);
    }
    /**
     * The ray through a point of the view, from -1 to 1 each way; it starts behind what is cut away.
     * @param {number} x @param {number} y
     */
    ray(x, y) {
        const {forward, right, up} = this.frame(), t = Math.tan(0.4), aspect = this.canvas.width / this.canvas.height;
        const d = add(add(forward, right, x * t * aspect), up, y * t);
        return {origin: add(this.eye(), d, this.near()), direction: unit(d)};
    }
    /**
     * Where a point of the scene is in the view, or null behind it.
     * @param {Vec} p
     */
    project(p) {
        const m = this.matrix(), w = m[3] * p[0] + m[7] * p[1] + m[11] * p[2] + m[15];
        if (w <= 0) return null;
        return [(m[0] * p[0] + m[4] * p[1] + m[8] * p[2] + m[12]) / w, (m[1] * p[0] + m[5] * p[1] + m[9] * p[2] + m[13]) / w];
    }
    /**
     * From -1 to 1.
     * @param {PointerEvent} e
     */
    at(e) { return [2 * e.offsetX / this.canvas.clientWidth - 1, 1 - 2 * e.offsetY / this.canvas.clientHeight]; }

    /**
     * The surface point seen in the view at (x, y), or null.
     * @param {number} x @param {number} y
     */
    async pick(x, y) {
        const {points} = await this.server.post('/v1/ray', this.ray(x, y));
        return points[0] ?? null;
    }

    /** Loads the geometry, in place of an earlier one. */
    async load() {
        const gl = this.gl;
        if (!gl) return;
        const shapes = await this.server.geometry();
        for (const {array, buffers} of this.shapes.splice(0)) {
            gl.deleteVertexArray(array);
            for (const b of buffers) gl.deleteBuffer(b);
        }
        for (const s of shapes) {
            const buffers = [gl.createBuffer(), gl.createBuffer(), gl.createBuffer()];
            const array = gl.createVertexArray();
            gl.bindVertexArray(array);
            gl.bindBuffer(gl.ARRAY_BUFFER, buffers[0]);
            gl.bufferData(gl.ARRAY_BUFFER, s.positions, gl.STATIC_DRAW);
            gl.enableVertexAttribArray(0);
            gl.vertexAttribPointer(0, 3, gl.UNSIGNED_SHORT, true, 0, 0);
            // The rows of each instance's matrix.
            gl.bindBuffer(gl.ARRAY_BUFFER, buffers[1]);
            gl.bufferData(gl.ARRAY_BUFFER, s.matrices, gl.STATIC_DRAW);
            for (const row of [0, 1, 2]) {
                gl.enableVertexAttribArray(1 + row);
                gl.vertexAttribPointer(1 + row, 4, gl.FLOAT, false, 48, 16 * row);
                gl.vertexAttribDivisor(1 + row, 1);
            }
            gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers[2]);
            // All triangles, and then the coarse ones.
            gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, 4 * (s.indices + s.coarse_indices), gl.STATIC_DRAW);
            gl.bufferSubData(gl.ELEMENT_ARRAY_BUFFER, 0, s.triangles);
            gl.bufferSubData(gl.ELEMENT_ARRAY_BUFFER, 4 * s.indices, s.coarse);
            gl.bindVertexArray(null);
            this.shapes.push({...s, array, buffers});
        }
        this.fullTime = 0;
        this.redraw();
    }

    /** Draws a view that moves. */
    move() {
        const kRest = 250;
        clearTimeout(this.moving);
        this.moving = setTimeout(() => { this.moving = undefined; this.redraw(); }, kRest);
        this.redraw();
    }
    /** Whether the view moves and all triangles would take too long. */
    isCoarse() { return this.moving !== undefined && this.fullTime > 25; }
    /**
     * Measures how long the graphics processor needs for a picture of all triangles.
     * @param {WebGL2RenderingContext} gl
     */
    measure(gl) {
        const begin = performance.now(), fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
        if (!fence) return;
        this.isMeasured = true;
        gl.flush();
        const look = () => {
            if (gl.getSyncParameter(fence, gl.SYNC_STATUS) === gl.UNSIGNALED && !gl.isContextLost()) { setTimeout(look, 2); return; }
            gl.deleteSync(fence);
            this.isMeasured = false;
            this.fullTime = performance.now() - begin;
        };
        setTimeout(look, 2);
    }

    redraw() {
        if (this.isDue) return;
        this.isDue = true;
        requestAnimationFrame(() => { this.isDue = false; this.draw(); });
    }

    draw() {
        const gl = this.gl;
        if (!gl || !this.meshProgram || !this.lineProgram || this.canvas.clientWidth === 0) return;
        fit(this.canvas);
        gl.viewport(0, 0, this.canvas.width, this.canvas.height);
        gl.clearColor(0.06, 0.065, 0.08, 1);
        gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
        gl.enable(gl.DEPTH_TEST);
        const transform = new Float32Array(this.matrix());
        gl.useProgram(this.meshProgram);
        const at = (/** @type {string} */ name) => gl.getUniformLocation(/** @type {WebGLProgram} */ (this.meshProgram), name);
        gl.uniformMatrix4fv(at('transform'), false, transform);
        gl.uniform3fv(at('eye'), this.eye());
        const isCoarse = this.isCoarse();
        this.drawnTriangles = 0;
        for (const s of this.shapes) {
            gl.uniform3fv(at('low'), s.low);
            gl.uniform3fv(at('extent'), s.high.map((/** @type {number} */ v, /** @type {number} */ i) => v - s.low[i]));
            gl.uniform3fv(at('tint'), s.emits ? [1, 0.9, 0.5] : s.delta ? [0.45, 0.6, 0.75] : s.color.map((/** @type {number} */ c) => 0.08 + 0.8 * c));
            gl.uniform1f(at('isLit'), s.emits ? 1 : 0);
            gl.bindVertexArray(s.array);
            const [first, count] = isCoarse && s.coarse_indices > 0 ? [s.indices, s.coarse_indices] : [0, s.indices];
            gl.drawElementsInstanced(gl.TRIANGLES, count, gl.UNSIGNED_INT, 4 * first, s.places);
            this.drawnTriangles += count / 3 * s.places;
        }
        if (!isCoarse && !this.isMeasured) this.measure(gl);
        this.drawLines(gl, transform);
        this.drawCross(gl);
    }

    /** @param {WebGL2RenderingContext} gl @param {Float32Array} transform */
    drawLines(gl, transform) {
        /** @type {number[]} */
        const segments = [];
        /** @type {number[]} */
        const marks = [];
        for (const line of Object.values(this.lines).flat()) {
            line.points.forEach((p, i) => {
                if (i > 0) segments.push(...line.points[i - 1], ...line.color, ...p, ...line.color);
                if (line.marks) marks.push(...p, ...(line.chosen === i ? [1, 1, 1, 1] : line.color));
            });
        }
        gl.enable(gl.BLEND);
        gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
        this.drawArrays(gl, transform, segments, gl.LINES);
        this.drawArrays(gl, transform, marks, gl.POINTS);
        gl.disable(gl.BLEND);
    }

    /**
     * Draws also what is hidden, but faintly.
     * @param {WebGL2RenderingContext} gl @param {Float32Array} transform @param {number[]} values @param {number} kind
     */
    drawArrays(gl, transform, values, kind) {
        if (values.length === 0 || !this.lineProgram) return;
        gl.bindVertexArray(null);
        gl.useProgram(this.lineProgram);
        gl.bindBuffer(gl.ARRAY_BUFFER, this.lineBuffer ?? null);
        gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(values), gl.DYNAMIC_DRAW);
        const position = gl.getAttribLocation(this.lineProgram, 'position'), tint = gl.getAttribLocation(this.lineProgram, 'tint');
        gl.enableVertexAttribArray(position);
        gl.enableVertexAttribArray(tint);
        gl.vertexAttribPointer(position, 3, gl.FLOAT, false, 28, 0);
        gl.vertexAttribPointer(tint, 4, gl.FLOAT, false, 28, 12);
        gl.uniformMatrix4fv(gl.getUniformLocation(this.lineProgram, 'transform'), false, transform);
        gl.uniform1f(gl.getUniformLocation(this.lineProgram, 'pointSize'), 9 * devicePixelRatio);
        const fade = gl.getUniformLocation(this.lineProgram, 'fade');
        gl.depthMask(false);
        gl.enable(gl.POLYGON_OFFSET_FILL);
        gl.depthFunc(gl.GREATER);
        gl.uniform1f(fade, 0.35);
        gl.drawArrays(kind, 0, values.length / 7);
        gl.depthFunc(gl.LEQUAL);
        gl.uniform1f(fade, 1);
        gl.drawArrays(kind, 0, values.length / 7);
        gl.depthFunc(gl.LESS);
        gl.depthMask(true);
    }

    /** @param {WebGL2RenderingContext} gl */
    drawCross(gl) {
        const [x, y] = this.cross, dx = 14 / this.canvas.clientWidth, dy = 14 / this.canvas.clientHeight;
        const identity = new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
        const white = [1, 1, 1, 1];
        gl.disable(gl.DEPTH_TEST);
        this.drawArrays(gl, identity, [x - dx, y, 0, ...white, x + dx, y, 0, ...white, x, y - dy, 0, ...white, x, y + dy, 0, ...white], gl.LINES);
        gl.enable(gl.DEPTH_TEST);
    }

    /** @param {number} dx @param {number} dy */
    orbit(dx, dy) {
        const eye = this.eye();
        this.azimuth = (this.azimuth ?? 0) - dx;
        this.height = clamp((this.height ?? 0) - dy, -1.55, 1.55);
        if (this.isWalking) this.target = add(eye, this.forward(), this.distance);
        this.move();
    }
    /**
     * Changes the distance of what the view turns about. Where it is close, the view goes on with it.
     * @param {number} factor
     */
    dolly(factor) {
        const distance = this.distance * factor, least = 0.01 * this.radius, kStep = 0.2;
        if (factor < 1 && distance < least) this.target = add(this.target, this.forward(), -Math.log(factor) * kStep * this.radius);
        this.distance = clamp(distance, least, 8 * this.radius);
        this.move();
    }

    /** @param {boolean} begins Or ends. */
    walk(begins) {
        this.isWalking = begins;
        this.pressed.clear();
        this.walkButton.setAttribute('aria-pressed', String(begins));
        this.tellSpeed();
    }
    tellSpeed() {
        this.label.textContent = this.isWalking ? `walking: ${significant(this.speed * this.radius, 2)} scene units a second` : '';
        this.tell.say(this.label.textContent || 'walking ends');
    }
    /**
     * Moves the eye for some seconds in the directions of the pressed keys.
     * @param {number} seconds
     */
    step(seconds) {
        const {forward, right} = this.frame(), axes = [right, this.vertical(), forward];
        const length = seconds * this.speed * this.radius * (this.runs ? 4 : 1);
        for (const key of this.pressed) kSteps[key].forEach((v, i) => { this.target = add(this.target, axes[i], v * length); });
        this.move();
    }
    /** Goes on for as long as keys are pressed. */
    keepWalking() {
        this.lastStep = performance.now();
        const go = (/** @type {number} */ now) => {
            if (this.pressed.size === 0) return;
            // After a pause of the page, no leap.
            this.step(clamp((now - this.lastStep) / 1000, 0, 0.1));
            this.lastStep = now;
            requestAnimationFrame(go);
        };
        requestAnimationFrame(go);
    }
    listenToKeys() {
        const canvas = this.canvas;
        canvas.addEventListener('keydown', e => {
            this.runs = e.shiftKey;
            if (!this.isWalking || e.ctrlKey || e.altKey || e.metaKey || !(e.code in kSteps)) return;
            e.preventDefault();
            e.stopPropagation();
            if (e.repeat || this.pressed.has(e.code)) return;
            const isFirst = this.pressed.size === 0, kTap = 1 / 60;
            this.pressed.add(e.code);
            this.step(kTap);
            if (isFirst) this.keepWalking();
        });
        canvas.addEventListener('keyup', e => {
            this.runs = e.shiftKey;
            this.pressed.delete(e.code);
        });
        canvas.addEventListener('blur', () => this.pressed.clear());
    }
    /** @param {number} dx @param {number} dy */
    moveCross(dx, dy) {
        this.cross = [clamp(this.cross[0] + dx, -1, 1), clamp(this.cross[1] + dy, -1, 1)];
        this.move();
    }

    listen() {
        this.listenToKeys();
        const canvas = this.canvas;
        /** @type {{x: number, y: number, kind: 'orbit' | 'pan' | 'point', moved: boolean} | null} */
        let drag = null;
        canvas.addEventListener('pointerdown', e => {
            canvas.setPointerCapture(e.pointerId);
            canvas.focus();
            const [x, y] = this.at(e);
            drag = {x: e.offsetX, y: e.offsetY, moved: false, kind: e.button === 2 || e.shiftKey ? 'pan' : this.tell.press(x, y) ? 'point' : 'orbit'};
        });
        canvas.addEventListener('pointermove', e => {
            if (!drag) return;
            const dx = e.offsetX - drag.x, dy = e.offsetY - drag.y;
            if (!drag.moved && Math.hypot(dx, dy) < 4) return;
            drag.moved = true;
            const [x, y] = this.at(e);
            if (drag.kind === 'orbit') this.orbit(dx * 0.006, dy * 0.006);
            else if (drag.kind === 'pan') {
                const {right, up} = this.frame(), f = this.distance * 0.85 / canvas.clientHeight;
                this.target = add(add(this.target, right, -dx * f), up, dy * f);
                this.move();
            } else this.tell.drag(x, y);
            [drag.x, drag.y] = [e.offsetX, e.offsetY];
        });
        canvas.addEventListener('pointerup', e => {
            const [x, y] = this.at(e);
            if (drag && !drag.moved && drag.kind === 'orbit') {
                this.cross = [x, y];
                this.tell.click(x, y);
                this.redraw();
            }
            if (drag?.kind === 'point') this.tell.release();
            drag = null;
        });
        canvas.addEventListener('contextmenu', e => e.preventDefault());
        canvas.addEventListener('wheel', e => {
            e.preventDefault();
            if (!this.isWalking) return this.dolly(Math.exp(e.deltaY * 0.0015));
            this.speed = clamp(this.speed * Math.exp(-e.deltaY * 0.002), 1e-4, 10);
            this.tellSpeed();
        }, {passive: false});
    }
}
