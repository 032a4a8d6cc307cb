// @ts-check
// The paths that made a pixel, traced again by the program, and drawn in the scene.

import {element, significant} from './controls.js';

const kMostDrawn = 200;

export class Inspector {
    /**
     * @param {HTMLElement} parent @param {import('./space.js').Space} space @param {import('./server.js').Server} server
     * @param {import('./paths.js').PathEditor} editor
     */
    constructor(parent, space, server, editor) {
        this.space = space;
        this.server = server;
        this.editor = editor;
        this.pixel = {x: 0, y: 0, run: 0};
        /** @type {any[]} */
        this.paths = [];
        /** Of all contributions but splats. */
        this.sum = [0, 0, 0];
        this.chosen = -1;
        /** Run of the paths; 0: there are none. */
        this.of = 0;
        this.request = 0;
        /** Whether the paths are all of a pass that was traced as a whole. */
        this.isWhole = false;
        this.place = element('span', {className: 'soft'});
        this.passes = element('input', {id: 'replay-passes', type: 'number', min: 1, value: 16});
        this.splats = element('input', {id: 'replay-splats', type: 'checkbox'});
        this.technique = element('select', {id: 'replay-technique', onchange: () => this.update()});
        this.message = element('p', {role: 'status'});
        this.list = element('div', {className: 'replayed', role: 'group', 'aria-label': 'Paths by contribution'});
        parent.append(this.place, element('div', {className: 'bar'}, [
            element('button', {type: 'button', textContent: 'Trace again', onclick: () => { this.replay(); }}),
            element('label', {}, ['passes ', this.passes]), element('label', {title: 'Trace one pass of light paths for those that are splatted'}, [this.splats, ' splats']),
            element('label', {}, ['technique ', this.technique]),
            element('button', {type: 'button', textContent: 'Clear', onclick: () => this.clear()})]), this.message, this.list);
    }

    /** @param {number} x @param {number} y @param {number} run */
    setPixel(x, y, run) {
        if (run !== this.of) this.clear();
        this.pixel = {x, y, run};
        this.place.textContent = run > 0 ? `run ${run}, pixel (${x}, ${y})` : `pixel (${x}, ${y}), no run`;
    }

    clear() {
        this.of = 0;
        ++this.request;
        this.message.textContent = '';
        if (this.paths.length === 0) return;
        this.paths = [];
        this.fill();
    }

    /**
     * Traces one pass of the pixel again; with the splats of this pass where the paths from the eye are not what made the pixel bright.
     * @param {number} pass @param {number} value Luminance of the pixel in this pass.
     */
    async replayPass(pass, value) {
        this.splats.checked = false;
        if (!await this.replay(pass)) return;
        const luminance = (/** @type {number[]} */ v) => 0.2126 * v[0] + 0.7152 * v[1] + 0.0722 * v[2];
        if (this.of > 0 && !this.isWhole && this.message.className === '' && luminance(this.sum) < 0.5 * value) {
            this.splats.checked = true;
            if (!await this.replay(pass)) return;
        }
        if (this.paths.length === 0) return;
        this.chosen = 0;
        this.update();
    }

    /**
     * Tells whether nothing else was asked for in the meantime.
     * @param {number} [pass] Only this pass.
     */
    async replay(pass) {
        const request = ++this.request, {x, y, run} = this.pixel;
        this.of = run;
        this.message.className = '';
        // Methods that share light paths answer between two passes.
        this.message.textContent = 'tracing, or waiting for the end of the pass …';
        try {
            const what = pass === undefined ? {passes: Number(this.passes.value)} : {pass, passes: 1};
            const r = await this.server.post('/v1/replay', {x, y, run, ...what, splats: this.splats.checked});
            if (request !== this.request) return false;
            this.paths = r.paths;
            this.sum = r.sum;
            const sum = r.sum.map((/** @type {number} */ v) => significant(v / Math.max(1, r.passes), 4)).join(', ');
            this.isWhole = 'pass' in r || Boolean(r.is_last_pass);
            this.message.textContent = `pixel (${x}, ${y}): ${r.paths.length} paths of ${r.is_last_pass ? `the last pass${pass === undefined ? '' : `, since nothing is kept from which pass ${pass} could be traced again`}` : pass !== undefined ? `pass ${pass}` : `${r.passes} passes`}${r.left_out ? `, ${r.left_out} left out` : ''}; mean without splats (${sum})`
                + (r.light_paths ? `; ${r.light_paths} light paths` : '');
        } catch (e) {
            if (request !== this.request) return false;
            this.paths = [];
            this.message.className = 'error';
            this.message.textContent = /** @type {Error} */ (e).message;
        }
        this.fill();
        return true;
    }

    fill() {
        const names = [...new Set(this.paths.map(p => this.name(p)))].sort();
        this.technique.replaceChildren(...['all', ...names].map(n => element('option', {value: n, textContent: n})));
        this.chosen = -1;
        this.update();
    }

    /** @param {any} p */
    name(p) { return `${p.technique.strategy} ${p.technique.s},${p.technique.t}`; }

    /**
     * Points of a path; those at infinity as far as the scene is large.
     * @param {any} p
     */
    points(p) {
        const finite = p.points.filter((/** @type {number[]} */ q) => !q[3]);
        return p.points.map((/** @type {number[]} */ q, /** @type {number} */ i) => {
            if (!q[3]) return q.slice(0, 3);
            const from = i === 0 ? finite[0] : finite[finite.length - 1];
            return from.slice(0, 3).map((/** @type {number} */ v, /** @type {number} */ c) => v + q[c] * 2 * this.space.radius);
        });
    }

    update() {
        const shown = this.paths.filter(p => this.technique.value === 'all' || this.name(p) === this.technique.value).slice(0, kMostDrawn);
        const luminance = (/** @type {any} */ p) => 0.2126 * p.value[0] + 0.7152 * p.value[1] + 0.0722 * p.value[2];
        const largest = Math.max(1e-30, ...shown.map(luminance));
        this.space.lines.replayed = shown.map((p, i) => ({points: this.points(p), marks: i === this.chosen,
            color: i === this.chosen ? [1, 1, 1, 1] : [0.5, 0.9, 1, 0.15 + 0.7 * Math.sqrt(luminance(p) / largest)]}));
        this.space.redraw();
        this.list.replaceChildren(...shown.map((p, i) => element('button', {type: 'button', 'aria-pressed': String(i === this.chosen),
            title: `pass ${p.pass}`, textContent: `${p.type.padEnd(7)} ${this.name(p).padEnd(16)} weight ${significant(p.weight, 2)}, value ${significant(luminance(p))}`,
            onclick: () => { this.chosen = i === this.chosen ? -1 : i; this.update(); this.list.children[i]?.focus(); }})));
        const chosen = shown[this.chosen];
        if (!chosen) return;
        this.list.children[this.chosen].after(element('button', {type: 'button', textContent: '  ↳ use as a light path', onclick: () => this.use(chosen)}));
    }

    /**
     * The light's side of a path, up to its last diffuse point before the eye, becomes a user path.
     * @param {any} p
     */
    use(p) {
        let last = p.points.length - 2;
        while (last > 0 && p.type[last] !== 'D') --last;
        if (last < 1 || p.points[0][3]) return this.editor.tell.fail('This path has no part that could be a light path.');
        this.editor.addAll([{points: this.points(p).slice(0, last + 1), name: `pixel ${this.pixel.x},${this.pixel.y}`}]);
        this.editor.run(() => this.editor.changed());
    }
}
