// @ts-check
// The list of runs, and the form for a new one, made from the tables of the program.

/**
 * An element with properties, attributes and children.
 * @param {string} name @param {Record<string, any>} [properties] @param {any} [children] @returns {any}
 */
export function element(name, properties = {}, children = []) {
    const e = document.createElement(name);
    for (const [key, value] of Object.entries(properties)) {
        if (key in e) /** @type {any} */ (e)[key] = value;
        else e.setAttribute(key, value);
    }
    e.append(...[children].flat().filter(c => c !== null));
    return e;
}

/** @param {number | null | undefined} v */
export function significant(v, digits = 3) {
    if (v === null || v === undefined || !Number.isFinite(v)) return '–';
    if (v === 0) return '0';
    const a = Math.abs(v);
    return a >= 1e6 || a < 1e-4 ? v.toExponential(digits - 1) : Number(v.toPrecision(digits)).toString();
}

/** @param {number} s */
const time = s => s < 100 ? `${s.toFixed(1)} s` : `${Math.floor(s / 60)}:${String(Math.floor(s % 60)).padStart(2, '0')} min`;

const kSymbols = {rendering: '▶', stopping: '⏳', stopped: '⏸', finished: '✓', failed: '✗'};

/** @param {any} run */
export function describe(run) {
    const error = run.error ? `, relative error ${significant(run.error[0])} (${significant(run.error[1])} to ${significant(run.error[2])})` : '';
    const seeds = run.seeds ? `${run.seeds[0]} of ${run.seeds[1]} seeds, ` : '';
    return `${seeds}${run.passes} spp, ${time(run.seconds)}, ${significant(run.rays / 1e6)} Mrays/s${error}`;
}

/**
 * What there is to say of the file of a run.
 * @param {any} run
 */
function describeFile(run) {
    const kept = run.file ? `; kept in ${run.file}${run.file_passes < run.passes ? ` (${run.file_passes} spp)` : ''}` : '';
    return kept + (run.file_problem ? `; not kept: ${run.file_problem}` : '') + (run.why_look_only ? `; it can only be looked at: ${run.why_look_only}` : '');
}

/**
 * Why pilots have chosen the method of a run.
 * @param {HTMLElement} details @param {any} auto
 */
function showChoice(details, auto) {
    const number = (/** @type {number} */ v) => v.toPrecision(2);
    const row = (/** @type {string} */ kind, /** @type {string[]} */ texts) =>
        element('tr', {}, texts.map(textContent => element(kind, {textContent})));
    const candidates = auto.candidates.map((/** @type {any} */ c) => row('td', c.images > 0
        ? [c.method, number(c.noise), number(c.missing), number(1e6 * c.sample_seconds), String(c.pixels)]
        : [c.method, 'no pilot', '', '', '']));
    details.replaceChildren(element('summary', {textContent: auto.message}),
        element('table', {}, [row('th', ['method', 'noise', 'missing light', 'µs a sample', 'pixels of the pilot']), ...candidates]));
    details.hidden = false;
}

export class RunList {
    /**
     * @param {HTMLElement} parent
     * @param {{act: (action: string, run: any) => void, shown: () => number, show: (run: any) => void}} tell
     */
    constructor(parent, tell) {
        this.parent = parent;
        this.tell = tell;
        /** @type {Map<number, any>} */
        this.rows = new Map();
    }

    /** @param {any} run */
    makeRow(run) {
        const figures = element('div', {className: 'figures'}), state = element('span'), name = element('span');
        const choice = element('details', {hidden: true});
        const button = (/** @type {string} */ text, /** @type {string} */ action) => element('button', {type: 'button',
            textContent: text, 'aria-label': `${text} run ${run.id}`, onclick: () => this.tell.act(action, run.id)});
        const toggle = element('button', {type: 'button'}), discard = button('Discard pass', 'discard');
        const box = element('div', {className: 'run'}, [
            element('div', {className: 'name'}, [state, name]), figures, choice,
            element('div', {className: 'bar'}, [
                element('button', {type: 'button', textContent: 'Show', 'aria-label': `Show run ${run.id}`, onclick: () => this.tell.show(run.id)}),
                toggle, discard, button('Save', 'save'), button('Remove', 'remove')])]);
        this.parent.append(box);
        return {box, figures, state, name, choice, toggle, discard};
    }

    /** @param {any[]} runs */
    update(runs) {
        for (const [id, row] of this.rows)
            if (!runs.some(r => r.id === id)) { row.box.remove(); this.rows.delete(id); }
        for (const run of runs) {
            let row = this.rows.get(run.id);
            if (!row) this.rows.set(run.id, row = this.makeRow(run));
            const isRendering = run.state === 'rendering', isInPass = isRendering || run.state === 'stopping';
            row.state.textContent = /** @type {any} */ (kSymbols)[run.state];
            row.state.title = run.state;
            const name = ` ${run.id}: ${run.integrator}`;
            if (row.name.textContent !== name) row.name.textContent = name;
            if (run.auto && row.choice.hidden) showChoice(row.choice, run.auto);
            const text = `${run.state}: ${describe(run)}${run.old_scene ? ' (earlier version of the scene)' : ''}${run.message ? `: ${run.message}` : ''}${run.warnings.map((/** @type {string} */ w) => `; ${w}`).join('')}${describeFile(run)}`;
            if (row.figures.textContent !== text) row.figures.textContent = text;
            row.figures.classList.toggle('error', run.state === 'failed' || Boolean(run.file_problem));
            row.toggle.disabled = Boolean(run.why_look_only);
            const label = isRendering ? 'Stop' : 'Continue';
            if (row.toggle.textContent !== label) {
                row.toggle.textContent = label;
                row.toggle.setAttribute('aria-label', `${label} run ${run.id}`);
                row.toggle.onclick = () => this.tell.act(label.toLowerCase(), run.id);
            }
            row.discard.disabled = !isInPass;
            row.box.classList.toggle('shown', run.id === this.tell.shown());
        }
    }
}

/** The runs in the folder of the program that are not open. */
export class KeptList {
    /**
     * @param {HTMLElement} parent
     * @param {{open: (file: string) => void, look: () => void}} tell
     */
    constructor(parent, tell) {
        this.tell = tell;
        this.title = element('summary');
        this.rows = element('div');
        parent.append(element('details', {}, [this.title, this.rows,
            element('button', {type: 'button', textContent: 'Look again', title: 'Look again into the folder', onclick: () => tell.look()})]));
        this.update([]);
    }

    /** @param {any[]} runs */
    update(runs) {
        const key = JSON.stringify(runs);
        if (this.rows.dataset.key === key) return;
        this.rows.dataset.key = key;
        this.title.textContent = `Kept runs: ${runs.length}`;
        this.rows.replaceChildren(...runs.map(run => element('div', {className: 'run'}, [
            element('div', {className: 'name', textContent: run.file}),
            element('div', {className: run.problem ? 'figures error' : 'figures', textContent: run.problem ?? `${run.integrator}, ${run.seeds ? `${run.seeds[0]} of ${run.seeds[1]} seeds` : `seed ${run.seed}`}, ${run.passes} spp`}),
            run.problem ? null : element('div', {className: 'bar'}, [element('button', {type: 'button', textContent: 'Open', 'aria-label': `Open ${run.file}`, onclick: () => this.tell.open(run.file)})])])));
    }
}

/** The images of files that pages have opened. */
export class ImageList {
    /**
     * @param {HTMLElement} parent
     * @param {{open: (files: File[]) => void, show: (id: number) => void, remove: (id: number) => void, shown: () => string}} tell
     */
    constructor(parent, tell) {
        this.tell = tell;
        this.rows = element('div');
        this.files = element('input', {type: 'file', id: 'image-files', multiple: true, hidden: true, accept: '.exr,.hdr,.pfm,.png,.jpg,.jpeg,.tga,.bmp,.pgm,.ppm,.etd',
            onchange: () => { tell.open([...this.files.files]); this.files.value = ''; }});
        parent.append(this.rows, this.files, element('button', {type: 'button', id: 'open-images', textContent: 'Open images',
            title: 'Images and kept runs of any folder, also by dropping them on the page', onclick: () => this.files.click()}));
    }

    /** @param {any[]} images @param {any} scene Of its size alone an image can be shown. */
    update(images, scene) {
        const key = JSON.stringify([images, this.tell.shown(), scene?.width, scene?.height]);
        if (this.rows.dataset.key === key) return;
        this.rows.dataset.key = key;
        const button = (/** @type {string} */ text, /** @type {any} */ image, /** @type {(id: number) => void} */ act) => element('button', {type: 'button',
            textContent: text, 'aria-label': `${text} ${image.file}`, onclick: () => act(image.id)});
        const fits = (/** @type {any} */ image) => !scene || (image.width === scene.width && image.height === scene.height);
        this.rows.replaceChildren(...images.map(image => element('div', {className: this.tell.shown() === viewOf(image.id) ? 'run shown' : 'run'}, [
            element('div', {className: 'name', textContent: image.file}),
            element('div', {className: 'figures', textContent: [`${image.width} × ${image.height}`, fits(image) ? '' : 'other size', image.note].filter(Boolean).join(', ')}),
            element('div', {className: 'bar'}, [button('Show', image, this.tell.show), button('Remove', image, this.tell.remove)])])));
    }
}

/**
 * The view that shows an opened image.
 * @param {number} id
 */
export const viewOf = id => `opened:${id}`;

export class RunForm {
    /**
     * @param {HTMLElement} parent @param {any[]} integrators
     * @param {{start: (request: any) => Promise<void>}} tell
     */
    constructor(parent, integrators, tell) {
        this.integrators = integrators;
        this.parameters = element('div', {className: 'parameters'});
        this.doc = element('p', {className: 'soft'});
        this.message = element('p', {className: 'error', role: 'alert'});
        this.name = element('select', {id: 'method'}, integrators.map(i => element('option', {value: i.name, textContent: i.name})));
        this.name.onchange = () => this.fill();
        this.sampler = element('select', {id: 'sampler'}, ['sobol', 'independent'].map(s => element('option', {value: s, textContent: s})));
        this.filterMode = element('select', {id: 'filter_mode', title: 'spread: an eye path contributes to all pixels that the filter reaches; sample: to its own pixel'},
            ['spread', 'sample'].map(m => element('option', {value: m, textContent: m})));
        this.seed = element('input', {id: 'seed', type: 'number', value: '0', min: '0'});
        this.spp = element('input', {id: 'spp', type: 'number', min: '1', placeholder: 'no limit'});
        this.techniques = element('input', {id: 'techniques', type: 'number', value: '0', min: '0', max: '64'});
        const experimental = element('input', {type: 'checkbox', id: 'experimental', onchange: () => this.fill()});
        this.experimental = experimental;
        const field = (/** @type {string} */ text, /** @type {any} */ input) => [element('label', {htmlFor: input.id, textContent: text}), input];
        parent.append(element('details', {open: true}, [element('summary', {textContent: 'New run'}),
            element('form', {onsubmit: (/** @type {Event} */ e) => { e.preventDefault(); this.start(tell.start); }}, [
                element('div', {className: 'parameters'}, field('method', this.name)), this.doc, this.parameters,
                element('label', {}, [experimental, ' experimental parameters']),
                element('div', {className: 'parameters'}, [field('sampler', this.sampler), field('filter mode', this.filterMode), field('seed', this.seed),
                    field('samples per pixel', this.spp), field('technique images, edges', this.techniques)].flat()),
                element('button', {type: 'submit', textContent: 'Start'}), this.message])]));
        this.fill();
    }

    /** @param {string} name */
    choose(name) {
        if (!this.integrators.some(i => i.name === name)) return;
        this.name.value = name;
        this.fill();
    }

    fill() {
        const entry = this.integrators.find(i => i.name === this.name.value);
        this.doc.textContent = entry.doc;
        this.parameters.replaceChildren(...entry.parameters.filter((/** @type {any} */ p) => !p.experimental || this.experimental.checked)
            .flatMap((/** @type {any} */ p) => {
                const id = `parameter-${p.name}`;
                const input = p.type === 'boolean'
                    ? element('select', {id, name: p.name, title: p.doc}, ['', 'true', 'false'].map(v => element('option', {value: v, textContent: v || `default (${p.default})`})))
                    : element('input', {id, name: p.name, title: p.doc, placeholder: p.default ?? '', autocomplete: 'off'});
                return [element('label', {htmlFor: id, textContent: p.name, title: p.doc}), input];
            }));
    }

    /** @param {(request: any) => Promise<void>} start */
    async start(start) {
        const given = [...this.parameters.querySelectorAll('[name]')].map(i => /** @type {HTMLInputElement} */ (i))
            .filter(i => i.value.trim()).map(i => `${i.name}=${i.value.trim()}`);
        /** @type {any} */
        const request = {action: 'start', integrator: this.name.value + (given.length ? `:${given.join(',')}` : ''),
            sampler: this.sampler.value, filter_mode: this.filterMode.value, seed: Number(this.seed.value), techniques: Number(this.techniques.value)};
        if (this.spp.value) request.spp = Number(this.spp.value);
        this.message.textContent = '';
        await start(request).catch(e => { this.message.textContent = e.message; });
    }
}
