// @ts-check
// The editor of user paths. Each edit is checked and saved by the program; the file is the one that mlt and mps read.

import {Refusal} from './server.js';
import {element, significant} from './controls.js';
import {coneOutline} from './space.js';

/** @typedef {[number, number, number]} Vec */
/** @typedef {{name: string, points: Vec[], cone: number | number[], radius?: number, on: boolean, verdict?: {ok: boolean, point?: number, problem?: string}}} Path */

/**
 * From press to release. Its moves wait in the queue and may be carried out after the release; undo takes back all of
 * them at once.
 * @typedef {{isRemembered: boolean}} Drag
 */

/**
 * Of the paths that are switched off.
 * @param {string} file
 */
const offFile = file => file.replace(/\.json$/, '') + '-off.json';

const kColors = [[1, 0.75, 0.3], [0.5, 0.8, 1], [0.6, 1, 0.6], [1, 0.6, 0.9], [1, 1, 0.5]];

export class PathEditor {
    /**
     * @param {HTMLElement} parent @param {import('./space.js').Space} space @param {import('./server.js').Server} server
     * @param {{pixel: () => {x: number, y: number}, start: (request: any) => Promise<number>, runs: () => Map<number, any>, fail: (text: string) => void}} tell
     */
    constructor(parent, space, server, tell) {
        this.space = space;
        this.server = server;
        this.tell = tell;
        this.file = 'paths.json';
        this.etags = {on: '', off: ''};
        /** Whether the file of the paths that are switched off has some. */
        this.hasOff = false;
        /** @type {Path[]} */
        this.paths = [];
        this.chosen = -1;
        this.point = -1;
        /** @type {string[]} */
        this.undone = [];
        /** @type {string[]} */
        this.done = [];
        this.version = 0;
        /** @type {Drag | null} */
        this.drag = null;
        /** Edits follow one another, each after the answer to the last. */
        this.queue = Promise.resolve();
        this.list = element('div', {className: 'paths', role: 'group', 'aria-label': 'Paths'});
        this.status = element('p', {className: 'soft', role: 'status'});
        this.gain = element('div', {role: 'status'});
        const button = (/** @type {string} */ text, /** @type {string} */ title, /** @type {() => any} */ onclick, id = '') => element('button', {type: 'button', textContent: text, title, onclick, id});
        this.length = element('input', {id: 'pick-length', type: 'number', min: 2, max: 16, value: 3});
        this.spp = element('input', {id: 'gain-spp', type: 'number', min: 1, value: 64});
        this.seeds = element('input', {id: 'gain-seeds', type: 'number', min: 3, max: 64, value: 8});
        const fileInput = element('input', {id: 'paths-file', value: this.file, size: 14});
        fileInput.onchange = () => this.open(fileInput.value).then(() => { fileInput.value = this.file; });
        parent.append(
            element('div', {className: 'bar'}, [element('label', {}, ['file ', fileInput])]),
            element('div', {className: 'bar'}, [button('New path', 'N', () => this.begin()), button('Undo', 'Ctrl+Z', () => this.undo()), button('Redo', 'Ctrl+Y', () => this.redo()),
                button('Continue by mirrors', 'T', () => this.run(() => this.trace())), button('Obey the law', 'M', () => this.run(() => this.solve())),
                button('Look from point', 'V', () => this.lookFromPoint()), button('Delete', 'Del', () => this.run(() => this.remove()))]),
            this.list, this.status,
            element('div', {className: 'bar'}, [button('Pick from pixel', 'Paths of a short run that reach the pixel', () => this.run(() => this.pick())),
                element('label', {}, ['of edges ', this.length])]),
            element('div', {className: 'bar'}, [button('Render with and without', 'Two runs of mlt in turns, with several seeds each', () => this.run(() => this.compare()), 'render-both'),
                element('label', {}, ['spp ', this.spp]), element('label', {}, ['seeds ', this.seeds])]), this.gain);
        space.tell = {...space.tell,
            click: (x, y) => { if (this.chosen >= 0) this.run(() => this.addPoint(x, y)); },
            press: (x, y) => this.choosePointAt(x, y),
            drag: (x, y) => {
                const drag = this.drag ??= {isRemembered: false};
                this.run(() => this.movePoint(x, y, drag), 'drag');
                return true;
            },
            release: () => { this.drag = null; },
        };
        this.open(this.file);
    }

    /**
     * Carries out an edit after those before it.
     * @param {() => Promise<any>} task @param {string} [kind] Of several that wait, only the last is done.
     */
    run(task, kind) {
        const version = kind ? (this.version += 1) : 0;
        this.queue = this.queue.then(async () => {
            if (kind && version !== this.version) return;
            await task();
        }).catch(e => this.tell.fail(e.message));
        return this.queue;
    }

    /**
     * Shows the paths of a file. Edits that wait belong to the one before it.
     * @param {string} file
     */
    open(file) {
        return this.run(async () => {
            const [on, off] = await Promise.all([this.server.paths(file), this.server.paths(offFile(file))]);
            // Undo would bring the paths of one file into another.
            if (file !== this.file) this.done = [], this.undone = [];
            this.file = file;
            this.hasOff = off.list.length > 0;
            this.etags = {on: on.etag, off: off.etag};
            const read = (/** @type {any[]} */ list, /** @type {boolean} */ isOn) => list.map(p => ({name: '', cone: 1, ...p, on: isOn}));
            this.paths = [...read(on.list, true), ...read(off.list, false)];
            this.chosen = this.paths.length - 1;
            this.point = -1;
            await this.check();
        });
    }
    snapshot() { return JSON.stringify(this.paths.map(({verdict, ...p}) => p)); }

    /** Keeps the state before an edit for undo. */
    remember() {
        this.done.push(this.snapshot());
        this.undone = [];
    }

    /** @param {string[]} from @param {string[]} to */
    async restore(from, to) {
        const text = from.pop();
        if (text === undefined) return;
        to.push(this.snapshot());
        this.paths = JSON.parse(text);
        this.chosen = Math.min(this.chosen, this.paths.length - 1);
        this.point = -1;
        await this.changed();
    }
    undo() { return this.run(() => this.restore(this.done, this.undone)); }
    redo() { return this.run(() => this.restore(this.undone, this.done)); }

    /** After an edit: check, draw, save. */
    async changed() {
        await this.check();
        await this.save();
    }

    async check() {
        const whole = this.paths.filter(p => p.points.length > 1);
        if (whole.length > 0) {
            const {verdicts} = await this.server.post('/v1/paths/check', {paths: whole.map(p => this.plain(p))});
            whole.forEach((p, i) => { p.verdict = verdicts[i]; });
        }
        this.update();
    }

    /**
     * As the file has it.
     * @param {Path} p
     */
    plain({name, points, cone, radius}) {
        return {points, cone, ...(name ? {name} : {}), ...(radius ? {radius} : {})};
    }

    async save() {
        const whole = this.paths.filter(p => p.points.length > 1);
        const list = (/** @type {boolean} */ isOn) => whole.filter(p => p.on === isOn).map(p => this.plain(p));
        try {
            this.etags.on = await this.server.putPaths(this.file, list(true), this.etags.on);
            if (list(false).length > 0 || this.hasOff) {
                this.etags.off = await this.server.putPaths(offFile(this.file), list(false), this.etags.off);
                this.hasOff = true;
            }
            this.status.textContent = `${list(true).length} paths saved in ${this.file}`;
        } catch (e) {
            if (!(e instanceof Refusal) || e.status !== 409) throw e;
            this.tell.fail('The paths were edited elsewhere; this is the newer list. Undo brings back yours.');
            this.done.push(this.snapshot());
            this.open(this.file);
        }
    }

    onEvent() {
        this.updateGain().catch(e => this.tell.fail(e.message));
    }

    // -- Edits.

    begin() {
        this.remember();
        this.paths.push({name: `path ${this.paths.length + 1}`, points: [], cone: 1, on: true});
        this.chosen = this.paths.length - 1;
        this.point = -1;
        this.space.canvas.focus();
        this.update();
    }

    path() { return this.paths[this.chosen]; }

    /** @param {number} x @param {number} y */
    async addPoint(x, y) {
        const hit = await this.space.pick(x, y);
        const path = this.path();
        if (!hit || !path) return;
        this.remember();
        const at = this.point >= 0 ? this.point + 1 : path.points.length;
        path.points.splice(at, 0, hit.point);
        if (this.point >= 0) this.point = at;
        this.space.label.textContent = `${hit.shape}${hit.emits ? ', emits' : ''}${hit.delta ? ', mirror or glass' : ''}`;
        await this.changed();
    }

    /** @param {number} x @param {number} y */
    choosePointAt(x, y) {
        const width = this.space.canvas.clientWidth, height = this.space.canvas.clientHeight;
        let best = 10;
        let found = false;
        this.paths.forEach((path, i) => path.points.forEach((p, j) => {
            const at = this.space.project(p);
            const d = at ? Math.hypot((at[0] - x) * width / 2, (at[1] - y) * height / 2) : Infinity;
            if (d >= best) return;
            [best, found] = [d, true];
            [this.chosen, this.point] = [i, j];
        }));
        if (found) this.update();
        return found;
    }

    /** @param {number} x @param {number} y @param {Drag} drag */
    async movePoint(x, y, drag) {
        const hit = await this.space.pick(x, y);
        if (!hit || !this.path()?.points[this.point]) return;
        if (!drag.isRemembered) this.remember();
        drag.isRemembered = true;
        this.path().points[this.point] = hit.point;
        await this.changed();
    }

    /** @param {number} dx @param {number} dy In the view. */
    async nudge(dx, dy) {
        const p = this.path()?.points[this.point], at = p && this.space.project(p);
        if (!at) return;
        const hit = await this.space.pick(at[0] + dx, at[1] + dy);
        if (!hit) return;
        this.remember();
        this.path().points[this.point] = hit.point;
        await this.changed();
    }

    async trace() {
        const points = this.path()?.points ?? [];
        if (points.length < 2) throw new Error('A path needs two points before mirrors can continue it.');
        const [a, b] = points.slice(-2);
        const direction = b.map((v, i) => v - a[i]);
        const length = Math.hypot(...direction);
        const origin = a.map((v, i) => v + direction[i] / length * 1e-4 * this.space.radius);
        const {points: met} = await this.server.post('/v1/ray', {origin, direction, trace: true});
        if (met.length < 2) throw new Error('The last point is on no mirror or clear glass.');
        this.remember();
        points.splice(points.length - 1, 1, ...met.map((/** @type {any} */ m) => m.point));
        await this.changed();
    }

    async solve() {
        const path = this.path();
        if (!path || this.point < 1) throw new Error('Select a point on a mirror or on glass between two others.');
        const {points, problem} = await this.server.post('/v1/paths/snap', {points: path.points, index: this.point});
        if (problem) throw new Error(`No such point: ${problem}.`);
        this.remember();
        path.points = points;
        await this.changed();
    }

    /** Looks from the selected point, or from the last one of the path. */
    lookFromPoint() {
        const points = this.path()?.points ?? [], p = points[this.point] ?? points[points.length - 1];
        if (!p) return this.tell.fail('The path has no point to look from.');
        this.space.lookFrom(p);
    }

    async remove() {
        const path = this.path();
        if (!path) return;
        this.remember();
        if (this.point >= 0) path.points.splice(this.point, 1);
        else this.paths.splice(this.chosen, 1);
        this.point = -1;
        this.chosen = Math.min(this.chosen, this.paths.length - 1);
        await this.changed();
    }

    async pick() {
        const pixel = this.tell.pixel();
        this.status.textContent = `looking for paths of pixel (${pixel.x}, ${pixel.y}) …`;
        this.seed = (this.seed ?? 0) + 1;
        const picked = await this.server.post('/v1/paths/pick', {...pixel, length: Number(this.length.value), count: 8, seed: this.seed});
        // At most two of the same number of points, which are mostly alike.
        this.addAll(picked.slice(0, 8));
        await this.changed();
    }

    /** @param {any[]} paths */
    addAll(paths) {
        this.remember();
        for (const p of paths) this.paths.push({name: '', cone: 1, ...p, on: true});
        this.chosen = this.paths.length - 1;
        this.point = -1;
    }

    async compare() {
        await this.changed();
        const request = {action: 'start', sampler: 'independent', spp: Number(this.spp.value), seeds: Number(this.seeds.value)};
        const without = await this.tell.start({...request, integrator: 'mlt:user_paths='});
        const with_ = await this.tell.start({...request, integrator: `mlt:user_paths=${this.file.replace(/[\\,]/g, '\\$&')}`});
        this.compared = {without, with: with_, seen: ''};
        await this.updateGain();
    }

    /** Requests the gain whenever another seed is finished. */
    async updateGain() {
        const compared = this.compared;
        if (!compared) return;
        const a = this.tell.runs().get(compared.without), b = this.tell.runs().get(compared.with);
        if (!a || !b) return;
        const seen = JSON.stringify([a.seeds, b.seeds, a.state, b.state]);
        if (seen === compared.seen) return;
        compared.seen = seen;
        const failed = [a, b].find(r => r.state === 'failed');
        const text = `run ${a.id} without, run ${b.id} with the paths: ${a.seeds[0]} and ${b.seeds[0]} of ${a.seeds[1]} seeds. `;
        if (failed) this.gain.textContent = `${text}Run ${failed.id} failed: ${failed.message}`;
        else {
            const gain = await this.server.get(`/v1/gain?without=${a.id}&with=${b.id}`);
            if (this.compared === compared && compared.seen === seen) this.gain.replaceChildren(element('p', {textContent: text + gainText(gain)}), gainTable(gain));
        }
    }

    // -- Keys.

    /** @param {KeyboardEvent} e Whether the key was used. */
    onKey(e) {
        if (e.ctrlKey && (e.key === 'z' || e.key === 'y')) {
            e.key === 'z' ? this.undo() : this.redo();
            return true;
        }
        if (e.ctrlKey || e.altKey || e.metaKey) return false;
        if (e.key === 'n') this.begin();
        else if (e.key === 'Delete') this.run(() => this.remove());
        else if (e.key === 't') this.run(() => this.trace());
        else if (e.key === 'm') this.run(() => this.solve());
        else if (e.key === 'v') this.lookFromPoint();
        else if (e.key === 'g') this.space.walk(!this.space.isWalking);
        else if (document.activeElement !== this.space.canvas) return false;
        else return this.onCanvasKey(e);
        return true;
    }

    /** @param {KeyboardEvent} e */
    onCanvasKey(e) {
        const step = (e.shiftKey ? 0.2 : 0.02);
        const move = {ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, step], ArrowDown: [0, -step]}[e.key];
        const turn = {a: [-0.08, 0], d: [0.08, 0], w: [0, -0.08], s: [0, 0.08]}[e.key];
        const last = (this.path()?.points.length ?? 0) - 1;
        if (move && this.point >= 0) this.run(() => this.nudge(move[0], move[1]));
        else if (move) this.space.moveCross(move[0], move[1]);
        else if (turn) this.space.orbit(turn[0], turn[1]);
        else if (e.key === 'q') this.space.dolly(1 / 1.1);
        else if (e.key === 'e') this.space.dolly(1.1);
        else if (e.key === 'Enter') this.run(() => this.addPoint(this.space.cross[0], this.space.cross[1]));
        else if (e.key === '[') this.choosePoint(this.point <= 0 ? last : this.point - 1);
        else if (e.key === ']') this.choosePoint(this.point >= last ? 0 : this.point + 1);
        else if (e.key === 'Escape') this.choosePoint(-1);
        else return false;
        return true;
    }

    /** @param {number} i */
    choosePoint(i) {
        this.point = i;
        this.update();
    }

    // -- What is shown.

    update() {
        this.space.lines.paths = this.paths.filter(p => p.points.length > 0).map(path => {
            const i = this.paths.indexOf(path);
            const color = path.verdict && !path.verdict.ok ? [1, 0.35, 0.3] : kColors[i % kColors.length];
            return {points: path.points, color: [...color, path.on ? 1 : 0.4], marks: true, chosen: i === this.chosen ? this.point : -1};
        });
        const chosen = this.path(), cones = [chosen?.cone ?? []].flat();
        this.space.lines.cones = chosen ? chosen.points.slice(1).flatMap((p, i) => coneOutline(chosen.points[i], p, cones[Math.min(i, cones.length - 1)])
            .map(points => ({points, color: [1, 1, 0.85, 0.55]}))) : [];
        this.space.redraw();
        const hadFocus = this.list.contains(document.activeElement) ? /** @type {any} */ (document.activeElement).dataset.key : null;
        this.list.replaceChildren(...this.paths.map((path, i) => this.row(path, i)));
        if (hadFocus) /** @type {HTMLElement | null} */ (this.list.querySelector(`[data-key="${hadFocus}"]`))?.focus();
    }

    /** @param {Path} path @param {number} i */
    row(path, i) {
        const name = path.name || `path ${i + 1}`;
        const edit = (/** @type {() => void} */ change) => this.run(async () => {
            this.remember();
            change();
            await this.changed();
        });
        const cones = [path.cone].flat();
        const verdict = path.points.length < 2 ? element('div', {className: 'soft', textContent: 'needs two points'})
            : !path.verdict ? null : path.verdict.ok ? element('div', {className: 'good', textContent: '✓ can be used'})
                : element('div', {className: 'error', textContent: `✗ point ${(path.verdict.point ?? 0) + 1} ${path.verdict.problem}`});
        return element('div', {className: i === this.chosen ? 'path chosen' : 'path'}, [
            element('input', {type: 'checkbox', checked: path.on, 'aria-label': `Use ${name}`, 'data-key': `on${i}`, onchange: () => edit(() => { path.on = !path.on; })}),
            element('input', {type: 'text', value: path.name, 'aria-label': `Name of path ${i + 1}`, 'data-key': `name${i}`,
                onchange: (/** @type {any} */ e) => edit(() => { path.name = e.target.value; })}), ' ',
            element('label', {}, ['cone ° ', element('input', {type: 'text', size: 5, value: cones.join(', '), title: 'One half-angle, or one for each segment', 'data-key': `cone${i}`,
                'aria-label': `Cone of ${name} in degrees`, onchange: (/** @type {any} */ e) => edit(() => {
                    const given = e.target.value.split(',').map(Number);
                    path.cone = given.length === 1 ? given[0] : given;
                })})]), ' ',
            element('label', {}, ['disc ', element('input', {type: 'text', size: 5, value: path.radius ?? '', title: 'Radius of the disc about the first point, in scene units; empty: 1 % of the radius of the scene, but at most 3 % of the extent of the path',
                'data-key': `radius${i}`, 'aria-label': `Radius of the disc of ${name}`, onchange: (/** @type {any} */ e) => edit(() => {
                    if (e.target.value.trim() === '') delete path.radius;
                    else path.radius = Number(e.target.value);
                })})]), ' ',
            element('button', {type: 'button', textContent: 'Select', 'aria-pressed': String(i === this.chosen), 'aria-label': `Select ${name}`, 'data-key': `select${i}`,
                onclick: () => { this.chosen = i; this.choosePoint(-1); }}), verdict,
            i === this.chosen ? element('div', {className: 'bar', role: 'group', 'aria-label': `Points of ${name}`}, path.points.map((p, j) => element('button', {type: 'button', textContent: String(j + 1),
                title: p.map(v => significant(v, 4)).join(', '), 'aria-pressed': String(j === this.point), 'aria-label': `Point ${j + 1} of ${name}`, 'data-key': `point${i}.${j}`,
                onclick: () => this.choosePoint(j)}))) : null]);
    }
}

/**
 * What the spread over the seeds says about the time that the user paths save.
 * @param {any} g
 */
function gainText(g) {
    const pair = (/** @type {(m: any) => any} */ use) => `${significant(use(g.without))} and ${significant(use(g.with))}`;
    const least = Math.min(g.without.seeds, g.with.seeds);
    if (least < 3) return 'No gain yet: it is computed from three seeds of each on.';
    const spread = `Relative variance of an image ${pair(m => m.variance)}, in ${pair(m => m.seconds)} s. `;
    const means = g.means_differ ? `The mean luminances ${significant(g.without.mean)} ± ${significant(g.without.mean_error, 2)} and ${significant(g.with.mean)} ± `
        + `${significant(g.with.mean_error, 2)} differ: one method rarely finds some of the light, so its variance is underestimated. ` : '';
    if (!g.gain) return `${spread}${means}No gain: in one of the methods, the seeds do not differ.`;
    const [gain, low, high] = g.gain;
    return `${spread}${means}With the paths, the same variance takes 1/${significant(gain)} of the time (95 %: 1/${significant(low)} to 1/${significant(high)}); `
        + `with as many samples, the variance is 1/${significant(g.ratio)}.`
        + (low < 1 && high > 1 ? ' Whether they help is undecided.' : '');
}

/**
 * Acceptance by mutation.
 * @param {any} g
 */
function gainTable(g) {
    const names = [...new Set([...Object.keys(g.without.mutations), ...Object.keys(g.with.mutations)])];
    if (names.length === 0) return '';
    const percent = (/** @type {any} */ m) => m?.accepted === undefined ? '–' : `${significant(100 * m.accepted)} %`;
    const head = (/** @type {string} */ text) => element('th', {scope: 'col', textContent: text});
    return element('table', {}, [element('tr', {}, [head('accepted'), head('without'), head('with')]),
        ...names.map(name => element('tr', {}, [element('th', {scope: 'row', textContent: name.replaceAll('_', ' ')}),
            element('td', {textContent: percent(g.without.mutations[name])}), element('td', {textContent: percent(g.with.mutations[name])})]))]);
}
