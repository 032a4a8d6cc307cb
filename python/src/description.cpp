// Descriptions of scenes: reading, dicts, edits by path; and scenes built from them.

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <set>

#include <fmt/format.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/variant.h>
#include <nanobind/stl/vector.h>
#include <nlohmann/json.hpp>

#include "bindings.h"
#include "embedded.h"
#include "readers/mitsuba_values.h"
#include "readers/mitsuba_writer.h"
#include "readers/mitsuba_xml.h"
#include "readers/nesting.h"
#include "readers/object_graph.h"
#include "readers/scene_file.h"
#include "render/plugin_list.h"
#include "render/scene_integrator.h"
#include "scene/builder.h"
#include "scene/plain_mitsuba.h"
#include "system/output_file.h"
#include "values.h"

namespace etendue::python {
namespace {

constexpr int kDeepestNesting = 64;

std::string text(nb::handle value) {
    return nb::cast<std::string>(value);
}

/// Whether the key stands for an object without a name: its category, with a number where there are several ("shape",
/// "shape_2").
bool is_automatic(std::string_view key, std::string_view category) {
    if (!key.starts_with(category)) return false;
    key.remove_prefix(category.size());
    if (key.empty()) return true;
    if (key.front() != '_' || key.size() == 1) return false;
    key.remove_prefix(1);
    return std::all_of(key.begin(), key.end(), [](char c) { return c >= '0' && c <= '9'; });
}

/// Reads dicts as mi.load_dict() takes them.
class DictReader {
public:
    /// `origin` names the dicts in messages.
    explicit DictReader(SceneDescription& scene, std::string origin = "dict")
        : scene_(scene), origin_(std::move(origin)) {}

    void read_scene(nb::dict d) {
        if (d.contains("type") &&
            !(nb::isinstance<nb::str>(d["type"]) && text(d["type"]) == "scene"))
            throw SceneError({origin_, 0}, "the outermost \"type\" must be \"scene\"");
        for (const auto& [key, value] : d) {
            const std::string name = key_of(key, "");
            if (name == "type") continue;
            if (!nb::isinstance<nb::dict>(value) || is_value(value))
                throw SceneError(at(name), "expected an object, a dict with a \"type\"");
            read_child(-1, name, value, name, false, 0);
        }
        finish();
    }
    /// Adds the object under `name` to `parent`, -1 for the scene itself. It may declare the ids of what only the child
    /// `replaced` of the parent has.
    void add(int parent, const std::string& name, nb::handle value, bool in_emitter,
             std::optional<size_t> replaced) {
        const std::vector<bool> is_reached = reached();
        // One of the scene is replaced for all that refer to it.
        const int without = replaced && parent < 0 ? scene_.roots[*replaced] : -1;
        stays_ = replaced ? reached(parent, *replaced, without) : is_reached;
        for (size_t i = 0; i < is_reached.size(); ++i) {
            std::string& id = scene_.objects[i].id;
            if (!is_reached[i]) id.clear();  // of what an edit has removed
            if (!id.empty()) ids_[id] = int(i);
        }
        read_child(parent, name, value, name, in_emitter, 0);
        finish();
    }

private:
    struct Reference {
        int parent;
        size_t slot;
        std::string id;
        SourceLocation where;
    };

    /// The objects that can be reached from the roots, but not by the given one of the children of a parent, nor by an object.
    std::vector<bool> reached(int without_parent = -2, size_t without_slot = 0,
                              int without = -1) const {
        std::vector<bool> is_reached(scene_.objects.size());
        std::vector<int> next;
        const auto add_all = [&](int parent, const auto& children, const auto& object_of) {
            for (size_t i = 0; i < children.size(); ++i)
                if ((parent != without_parent || i != without_slot) &&
                    object_of(children[i]) != without)
                    next.push_back(object_of(children[i]));
        };
        add_all(-1, scene_.roots, [](int object) { return object; });
        while (!next.empty()) {
            const int index = next.back();
            next.pop_back();
            if (is_reached[size_t(index)]) continue;
            is_reached[size_t(index)] = true;
            add_all(index, scene_.objects[size_t(index)].children,
                    [](const SceneObject::Child& c) { return c.object; });
        }
        return is_reached;
    }
    SourceLocation at(const std::string& path) const { return {origin_ + ": " + path, 0}; }
    std::string key_of(nb::handle key, const std::string& path) const {
        if (!nb::isinstance<nb::str>(key))
            throw SceneError(at(path),
                             fmt::format("the key {} is not a text", text(nb::repr(key))));
        return text(key);
    }
    void finish() {
        for (const Reference& r : references_) {
            const auto found = ids_.find(r.id);
            if (found == ids_.end()) {
                std::vector<std::string> known;
                for (const auto& [id, object] : ids_) known.push_back(id);
                throw SceneError(r.where, fmt::format("no object has the id {}{}", quote(r.id),
                                                      hint(r.id, known)));
            }
            if (r.parent < 0) {
                scene_.roots[r.slot] = found->second;
                continue;
            }
            SceneObject& parent = scene_.objects[size_t(r.parent)];
            check_nesting(parent.category, scene_.objects[size_t(found->second)].category, r.where);
            parent.children[r.slot].object = found->second;
        }
        references_.clear();
        check_object_graph(scene_, kDeepestNesting);
    }

    void read_child(int parent, const std::string& key, nb::handle value, const std::string& path,
                    bool in_emitter, int depth) {
        if (depth > kDeepestNesting) throw SceneError(at(path), "objects are nested too deeply");
        const auto d = nb::borrow<nb::dict>(value);
        if (!d.contains("type") || !nb::isinstance<nb::str>(d["type"]))
            throw SceneError(at(path), "expected a \"type\", the name of a plug-in");
        const std::string type = text(d["type"]);
        if (type == "ref") {
            if (!d.contains("id") || d.size() != 2)
                throw SceneError(at(path), "a \"ref\" has an \"id\" and nothing else");
            add_to(parent, is_any_automatic(key) || parent < 0 ? "" : key, -1, path);
            references_.push_back({parent, slots(parent) - 1, text(d["id"]), at(path)});
            return;
        }
        const std::string category = category_of(type, at(path));
        if (parent >= 0) check_nesting(scene_.objects[size_t(parent)].category, category, at(path));
        const int index = int(scene_.objects.size());
        scene_.objects.push_back({.category = category,
                                  .type = type,
                                  .id = {},
                                  .where = at(path),
                                  .params = {},
                                  .children = {}});
        const bool is_named = !is_automatic(key, category);
        if (d.contains("id"))
            declare(text(d["id"]), index, path);
        else if (parent < 0 && is_named)
            declare(key, index, path);
        add_to(parent, parent >= 0 && is_named ? key : "", index, path);
        const bool inside = in_emitter || category == "emitter";
        nb::dict parts;
        for (const auto& [inner_key, inner] : d) {
            const std::string name = key_of(inner_key, path);
            if (name == "type" || name == "id") continue;
            if (is_embedded_part(scene_.objects[size_t(index)], name))
                parts[inner_key] = inner;
            else
                read_entry(index, name, inner, path + "/" + name, inside, depth + 1);
        }
        if (parts.size() == 0) return;
        const SceneObject& object = scene_.objects[size_t(index)];
        for (const char* other : {embedded_parameter(object), "filename"})
            if (object.find(other))
                throw SceneError(at(path),
                                 fmt::format("give {} or {}, not both",
                                             quote(text((*parts.begin()).first)), quote(other)));
        embed(scene_, index, parts, at(path));
    }
    void read_entry(int index, const std::string& name, nb::handle value, const std::string& path,
                    bool in_emitter, int depth) {
        SceneObject& object = scene_.objects[size_t(index)];
        const char* const embedded = embedded_parameter(object);
        if (embedded && name == embedded && nb::isinstance<nb::dict>(value))
            return embed(scene_, index, nb::borrow<nb::dict>(value), at(path));
        if (!is_value(value)) return read_child(index, name, value, path, in_emitter, depth);
        ValueContext context{object.category, name, {}, in_emitter, at(path)};
        if (const PluginInfo* info = find_plugin(object.category, object.type))
            for (const ParamInfo& p : info->params)
                if (name == p.name) context.kind = p.kind;
        object.params.push_back({name, to_value(value, context), at(path)});
    }

    static bool is_any_automatic(const std::string& key) {
        for (const std::string& c : object_categories())
            if (is_automatic(key, c)) return true;
        return false;
    }
    size_t slots(int parent) const {
        return parent < 0 ? scene_.roots.size() : scene_.objects[size_t(parent)].children.size();
    }
    void add_to(int parent, const std::string& name, int object, const std::string& path) {
        if (parent < 0)
            scene_.roots.push_back(object);
        else
            scene_.objects[size_t(parent)].children.push_back({name, object, at(path)});
    }
    void declare(const std::string& id, int index, const std::string& path) {
        if (const auto [known, is_new] = ids_.emplace(id, index); !is_new) {
            const auto other = size_t(known->second);
            if (other >= stays_.size() || stays_[other])
                throw SceneError(at(path), fmt::format("the id {} is taken", quote(id)));
            scene_.objects[other].id.clear();
            known->second = index;
        }
        scene_.objects[size_t(index)].id = id;
    }

    SceneDescription& scene_;
    std::string origin_;
    std::map<std::string, int> ids_;
    std::vector<bool> stays_;  ///< Whether an object of before keeps its id.
    std::vector<Reference> references_;
};

struct Named {
    std::string key;
    int object;
};

/// The objects of the scene (-1) or of an object by the keys under which paths and dicts have them.
std::vector<Named> children_of(const SceneDescription& scene, int index) {
    std::vector<Named> all;
    if (index < 0)
        for (const int root : scene.roots) all.push_back({scene.objects[size_t(root)].id, root});
    else
        for (const auto& c : scene.objects[size_t(index)].children)
            all.push_back({c.name, c.object});
    // Names may be like automatic keys.
    std::set<std::string> names;
    for (const Named& c : all) names.insert(c.key);
    std::map<std::string, int> used;
    for (Named& c : all) {
        if (!c.key.empty()) continue;
        const std::string& category = scene.objects[size_t(c.object)].category;
        do {
            const int number = ++used[category];
            c.key = number == 1 ? category : fmt::format("{}_{}", category, number);
        } while (names.contains(c.key));
    }
    return all;
}

/// Objects that are used several times are written where they are first used; then they are named by their ids, which
/// those without one get.
class DictWriter {
public:
    explicit DictWriter(const SceneDescription& scene)
        : scene_(scene), is_written_(scene.objects.size()), uses_(scene.objects.size()) {
        for (const int root : scene.roots) ++uses_[size_t(root)];
        for (const SceneObject& o : scene.objects) {
            if (!o.id.empty()) ids_.insert(o.id);
            for (const SceneObject::Child& c : o.children) ++uses_[size_t(c.object)];
        }
    }
    nb::dict scene() {
        nb::dict d;
        d["type"] = "scene";
        for (const Named& c : children_of(scene_, -1)) {
            // The key of an object of the scene is its id.
            ids_.insert(c.key);
            d[c.key.c_str()] = object(c.object, true);
        }
        return d;
    }
    nb::dict object(int index, bool is_root) {
        const SceneObject& o = scene_.objects[size_t(index)];
        nb::dict d;
        if (is_written_[size_t(index)]) {
            d["type"] = "ref";
            d["id"] = o.id.empty() ? made_ids_.at(index) : o.id;
            return d;
        }
        is_written_[size_t(index)] = true;
        d["type"] = o.type;
        // The key of a root is its id, unless keys like this one stand for objects without an id.
        if (!o.id.empty() && (!is_root || is_automatic(o.id, o.category))) d["id"] = o.id;
        if (o.id.empty() && uses_[size_t(index)] > 1) d["id"] = make_id(index, o.category);
        const char* const embedded = embedded_parameter(o);
        for (const Param& p : o.params)
            d[p.name.c_str()] = embedded && p.name == embedded ? embedded_to_python(scene_, o, p)
                                                               : to_python(p.value);
        for (const Named& c : children_of(scene_, index))
            d[c.key.c_str()] = object(c.object, false);
        return d;
    }

private:
    /// Unlike automatic keys: "bsdf-1".
    std::string make_id(int index, const std::string& category) {
        std::string id;
        do id = fmt::format("{}-{}", category, ++numbers_[category]);
        while (!ids_.insert(id).second);
        return made_ids_[index] = id;
    }

    const SceneDescription& scene_;
    std::vector<bool> is_written_;
    std::vector<int> uses_;
    std::set<std::string> ids_;
    std::map<int, std::string> made_ids_;
    std::map<std::string, int> numbers_;
};

/// What a path such as "ball.bsdf.reflectance" names: an object, or a parameter of one (`parameter` is not empty).
struct Place {
    int object = -1;  ///< -1: the scene.
    std::string parameter;
    int parent = -1;
    size_t slot = 0;  ///< Of the object among those of its parent.
    bool in_emitter = false;
};

Place find(const SceneDescription& scene, const std::string& path) {
    Place at;
    std::string_view rest = path;
    while (!rest.empty()) {
        const std::vector<Named> children = children_of(scene, at.object);
        size_t best = 0, length = 0;
        for (size_t i = 0; i < children.size(); ++i) {
            const std::string& key = children[i].key;
            const bool fits = rest == key || (rest.starts_with(key) && rest[key.size()] == '.');
            if (fits && key.size() >= length) best = i, length = key.size();
        }
        if (length == 0) {
            at.parameter = rest;
            return at;
        }
        at.parent = at.object;
        at.slot = best;
        at.object = children[best].object;
        at.in_emitter |= scene.objects[size_t(at.object)].category == "emitter";
        rest.remove_prefix(std::min(rest.size(), length + 1));
    }
    return at;
}

/// Throws SceneError with what an object could have been asked for.
[[noreturn]] void fail_unknown(const SceneDescription& scene, const std::string& path,
                               const Place& at) {
    std::vector<std::string> known;
    for (const Named& c : children_of(scene, at.object)) known.push_back(c.key);
    std::string owner = "the scene";
    if (at.object >= 0) {
        const SceneObject& o = scene.objects[size_t(at.object)];
        owner = fmt::format("{} \"{}\"", o.category, o.type);
        if (const PluginInfo* info = find_plugin(o.category, o.type))
            for (const ParamInfo& p : info->params)
                if (std::find(known.begin(), known.end(), p.name) == known.end())
                    known.push_back(p.name);
    }
    throw SceneError({path, 0}, fmt::format("{} has no {}{}", owner, quote(at.parameter),
                                            hint(at.parameter, known)));
}

nb::object get(const Description& scene, const std::string& path) {
    const Place at = find(scene, path);
    if (at.parameter.empty())
        return at.object < 0 ? DictWriter(scene).scene()
                             : DictWriter(scene).object(at.object, at.parent < 0);
    if (at.object >= 0) {
        const SceneObject& o = scene.objects[size_t(at.object)];
        if (const Param* p = o.find(at.parameter)) {
            const char* const embedded = embedded_parameter(o);
            return embedded && p->name == embedded ? embedded_to_python(scene, o, *p)
                                                   : to_python(p->value);
        }
        if (nb::object part = embedded_part(scene, o, at.parameter); !part.is_none()) return part;
    }
    fail_unknown(scene, path, at);
}

bool contains(const Description& scene, const std::string& path) {
    const Place at = find(scene, path);
    if (at.object < 0) return false;
    const SceneObject& o = scene.objects[size_t(at.object)];
    return at.parameter.empty() || o.find(at.parameter) ||
           !embedded_part(scene, o, at.parameter).is_none();
}

void erase(Description& scene, const std::string& path) {
    const Place at = find(scene, path);
    if (at.parameter.empty() && at.object >= 0) {
        if (at.parent < 0)
            scene.roots.erase(scene.roots.begin() + std::ptrdiff_t(at.slot));
        else {
            auto& children = scene.objects[size_t(at.parent)].children;
            children.erase(children.begin() + std::ptrdiff_t(at.slot));
        }
        return;
    }
    if (at.object >= 0)
        if (std::erase_if(scene.objects[size_t(at.object)].params,
                          [&](const Param& p) { return p.name == at.parameter; }) > 0)
            return;
    fail_unknown(scene, path, at);
}

/// Names of parameters are those of the plug-in's table, so that a misspelt one is an error at once.
void check_name(const SceneDescription& scene, const std::string& path, const Place& at) {
    if (at.object < 0) fail_unknown(scene, path, at);
    const SceneObject& o = scene.objects[size_t(at.object)];
    const PluginInfo* info = find_plugin(o.category, o.type);
    if (!info) return;
    for (const ParamInfo& p : info->params)
        if (at.parameter == p.name) return;
    fail_unknown(scene, path, at);
}

/// What refers to the object `old` refers to `made` instead.
void refer_to(SceneDescription& scene, int made, int old, const SourceLocation& where) {
    for (SceneObject& o : scene.objects)
        for (SceneObject::Child& c : o.children) {
            if (c.object != old) continue;
            check_nesting(o.category, scene.objects[size_t(made)].category, where);
            c.object = made;
        }
    check_object_graph(scene, kDeepestNesting);
}

void set_in(SceneDescription& scene, const std::string& path, nb::handle value) {
    const Place at = find(scene, path);
    const SourceLocation where{path, 0};
    if (at.object >= 0 && !at.parameter.empty()) {
        const SceneObject& object = scene.objects[size_t(at.object)];
        if (const char* embedded = embedded_parameter(object);
            embedded && at.parameter == embedded && nb::isinstance<nb::dict>(value))
            return embed(scene, at.object, nb::borrow<nb::dict>(value), where);
        if (is_embedded_part(object, at.parameter))
            return embed(scene, at.object, with_part(scene, object, at.parameter, value), where);
    }
    if (!is_value(value)) {
        // An object: in the place of the old one, or added.
        const int parent = at.parameter.empty() ? at.parent : at.object;
        const std::string key =
            at.parameter.empty() ? children_of(scene, at.parent)[at.slot].key : at.parameter;
        const bool replaces = at.parameter.empty() && at.object >= 0;
        if (parent >= 0)
            std::erase_if(scene.objects[size_t(parent)].params,
                          [&](const Param& p) { return p.name == key; });
        if (replaces && parent < 0) scene.objects[size_t(at.object)].id.clear();
        DictReader(scene).add(parent, key, value, at.in_emitter,
                              replaces ? std::optional(at.slot) : std::nullopt);
        if (!replaces) return;
        // The new one is the last.
        if (parent < 0) {
            scene.roots[at.slot] = scene.roots.back();
            scene.roots.pop_back();
            refer_to(scene, scene.roots[at.slot], at.object, where);
        } else {
            auto& children = scene.objects[size_t(parent)].children;
            children[at.slot] = children.back();
            children.pop_back();
        }
        return;
    }
    Place target = at;
    if (at.parameter.empty()) {
        // A value in the place of an object, such as a colour in that of a texture.
        if (at.object < 0 || at.parent < 0) throw SceneError(where, "expected an object");
        target.object = at.parent;
        target.parameter = children_of(scene, at.parent)[at.slot].key;
    }
    check_name(scene, path, target);
    SceneObject& object = scene.objects[size_t(target.object)];
    ValueContext context{object.category, target.parameter, {}, target.in_emitter, where};
    if (const PluginInfo* info = find_plugin(object.category, object.type))
        for (const ParamInfo& p : info->params)
            if (target.parameter == p.name) context.kind = p.kind;
    Param changed{target.parameter, to_value(value, context), where};
    if (at.parameter.empty())
        object.children.erase(object.children.begin() + std::ptrdiff_t(at.slot));
    // An image is read from a file or from memory.
    if (const char* embedded = embedded_parameter(object); embedded && changed.name == "filename")
        std::erase_if(object.params, [&](const Param& p) { return p.name == embedded; });
    for (Param& p : object.params)
        if (p.name == changed.name) {
            p = std::move(changed);
            return;
        }
    object.params.push_back(std::move(changed));
}

/// All or nothing: a value that is refused leaves the description as it was. Copies of descriptions share their meshes and
/// images.
void set(Description& scene, const std::string& path, nb::handle value) {
    Description changed = scene;
    set_in(changed, path, value);
    if (const Place at = find(changed, path); at.object >= 0 && !at.parameter.empty()) {
        // The type is that of the table.
        const SceneObject& o = changed.objects[size_t(at.object)];
        if (const PluginInfo* info = find_plugin(o.category, o.type))
            check_params(changed, at.object, *info,
                         [&](const SourceLocation& where, const std::string& message) {
                             throw SceneError(where, message);
                         });
    }
    scene = std::move(changed);
}

std::vector<std::string> paths(const Description& scene) {
    // Groups of shapes within others multiply the paths that lead to what they contain.
    constexpr size_t kMostPaths = 1'000'000;
    std::vector<std::string> all;
    const std::function<void(int, const std::string&, int)> visit =
        [&](int index, const std::string& prefix, int depth) {
            if (index >= 0)
                for (const Param& p : scene.objects[size_t(index)].params)
                    all.push_back(prefix + p.name);
            for (const Named& c : children_of(scene, index)) {
                all.push_back(prefix + c.key);
                if (all.size() > kMostPaths)
                    throw nb::value_error("the description has more than 1000000 paths");
                if (depth < kDeepestNesting) visit(c.object, prefix + c.key + ".", depth + 1);
            }
        };
    visit(-1, "", 0);
    return all;
}

/// A sensor as BuildOptions name it.
struct SensorText {
    std::string operator()(int number) const { return std::to_string(number); }
    std::string operator()(const std::string& name) const {
        if (name.empty()) throw nb::value_error("sensor must be a number or a name, but is empty");
        return name;
    }
};

/// Builds a copy, since other threads may edit the description in the meantime.
ScenePtr build(Description& edited, const std::optional<std::pair<int, int>>& resolution,
               const std::optional<std::array<int, 4>>& crop, bool lenient, bool watertight,
               int threads, const std::optional<std::variant<int, std::string>>& sensor) {
    BuildOptions options;
    if (sensor) options.sensor = std::visit(SensorText{}, *sensor);
    options.threads = checked_threads(threads);
    options.lenient = lenient;
    options.accelerator.is_watertight = watertight;
    if (resolution) {
        const auto [w, h] = *resolution;
        if (w < 1 || h < 1 || w > 65536 || h > 65536)
            throw nb::value_error("resolution must lie between (1, 1) and (65536, 65536)");
        options.resolution = resolution;
    }
    options.crop = crop;
    use_threads();
    Description description = edited;
    options.earlier = edited.built;
    ScenePtr handle;
    {
        const nb::gil_scoped_release no_gil;
        BuiltScene built = build_scene_again(description, options);
        description.built = std::move(built.parts);
        handle = std::make_shared<SceneHandle>(std::move(description), std::move(built.scene));
    }
    handle->lenient = lenient;
    handle->watertight = watertight;
    edited.built = handle->description.built;
    return handle;
}

nb::dict info(const SceneHandle& s) {
    const Scene& scene = s.scene;
    const Scene::Statistics& st = scene.statistics();
    double power = 0;
    for (const auto& e : scene.emitters()) power += e->power();
    nb::dict d;
    d["shapes"] = scene.shapes().size();
    d["triangles"] = st.triangles;
    d["quadrics"] = st.quadrics;
    d["instances"] = st.instances;
    d["materials"] = st.materials;
    d["textures"] = st.textures;
    d["emitters"] = scene.emitters().size();
    d["emitters_at_infinity"] = scene.infinite_emitters().size();
    d["emitted_power"] = power;
    d["filter"] = scene.filter().name();
    d["geometry_bytes"] = st.geometry_bytes;
    d["texture_bytes"] = st.texture_bytes;
    d["accelerator_bytes"] = st.accelerator_bytes;
    return d;
}

ReadOptions read_options(const std::map<std::string, std::string>& defines, bool lenient) {
    ReadOptions options;
    options.defines = defines;
    options.lenient = lenient;
    return options;
}

nb::list matrix(const std::optional<Transform>& t) {
    if (!t)
        throw nb::value_error("origin and target must differ, and up must not point along the "
                              "viewing direction");
    return nb::cast<nb::list>(to_python(*t));
}

/// Writes the description as XML, with the meshes and images that it holds beside it. Returns what differs in Mitsuba.
std::vector<std::string> save(SceneDescription scene, const std::string& file, bool is_plain) {
    const std::filesystem::path path(file);
    if (path.extension() != ".xml")
        throw nb::value_error(
            fmt::format("a description is saved as .xml, not as {}", quote(file)).c_str());
    const nb::gil_scoped_release no_gil;
    std::vector<std::string> notes;
    if (is_plain) notes = make_plain_mitsuba(scene);
    const std::string xml =
        write_mitsuba_xml(scene, file, path.stem().string() + "_files", [&](const SceneFile& part) {
            write_file((path.parent_path() / part.name).string(), part.bytes);
        });
    write_file(file, xml);
    return notes;
}

/// A view of a mapping, such as that of dict.items().
nb::object view(const char* kind, nb::handle mapping) {
    return nb::module_::import_("collections.abc").attr(kind)(mapping);
}

nb::str html(const char* function, nb::handle of) {
    return nb::cast<nb::str>(nb::module_::import_("etendue._html").attr(function)(of));
}

nb::object scattering(const char* query, nb::handle scene, nb::handle at, nb::handle more) {
    return nb::module_::import_("etendue._scattering").attr(query)(scene, at, more);
}

nb::object rays(const char* query, nb::handle scene, nb::handle origins, nb::handle directions,
                nb::handle max_distance) {
    return nb::module_::import_("etendue._rays")
        .attr(query)(scene, origins, directions, max_distance);
}

}  // namespace

void bind_description(nb::module_& m) {
    using namespace nb::literals;
    nb::exception<SceneError>(m, "SceneError", PyExc_ValueError).attr("__doc__") =
        "An invalid scene: the message says where, what was expected, and what is near.";

    nb::class_<Description>(
        m, "Description",
        "The contents of a scene as plain data: objects with named parameters. Edit it by path, "
        "and "
        "build() scenes from it.\n\n"
        "A path joins keys by dots: \"ball.bsdf.reflectance\". The key of an object is its id or "
        "its "
        "parameter name; without either its category (\"sensor\", \"shape\", \"shape_2\").\n\n"
        "    description = et.load(\"scenes/cornell.xml\")\n"
        "    description[\"white.bsdf.reflectance\"] = (0.9, 0.8, 0.7)\n"
        "    description[\"lens\"] = {\"type\": \"sphere\", \"radius\": 0.2, \"center\": (0, 0.5, "
        "0)}\n"
        "    matching = [path for path in description if path.endswith(\"reflectance\")]\n"
        "    del description[\"lens\"]\n\n"
        "It keeps what its last build() made, so that the next one makes only what an edit has "
        "changed.")
        .def("__getitem__", &get, "path"_a,
             "The parameter or object that a path names: a number, a text, a list of 3 numbers, a "
             "colour as {\"type\": \"rgb\"}, a 4x4 list, or a dict.")
        .def("__setitem__", &set, "path"_a, "value"_a,
             "Sets a parameter, or replaces or adds an object given as a dict; an object of the "
             "scene is replaced for all that refer to it. Raises SceneError for "
             "an unknown name or a value of the wrong type, and changes nothing then.")
        .def("__delitem__", &erase, "path"_a, "Removes a parameter or an object.")
        .def(
            "__iter__", [](const Description& d) { return nb::iter(nb::cast(paths(d))); },
            nb::sig("def __iter__(self) -> collections.abc.Iterator[str]"),
            "Iterates over paths().")
        .def(
            "__len__", [](const Description& d) { return paths(d).size(); },
            "The number of paths().")
        .def(
            "keys", [](nb::handle self) { return view("KeysView", self); },
            nb::sig("def keys(self) -> collections.abc.KeysView[str]"),
            "The paths() as a view, like dict.keys().")
        .def(
            "values", [](nb::handle self) { return view("ValuesView", self); },
            nb::sig("def values(self) -> collections.abc.ValuesView[object]"),
            "What the paths() name, as a view, like dict.values().")
        .def(
            "items", [](nb::handle self) { return view("ItemsView", self); },
            nb::sig("def items(self) -> collections.abc.ItemsView[str, object]"),
            "The paths() with what they name, as a view, like dict.items().")
        .def("_ipython_key_completions_", &paths)
        .def("_repr_html_", [](nb::handle self) { return html("description_html", self); })
        .def("__repr__",
             [](const Description& d) {
                 return fmt::format("<Description {}, {} objects>", d.file, d.objects.size());
             })
        .def("__contains__", &contains, "path"_a,
             "Whether the description has a parameter or object of this path.")
        .def(
            "copy", [](const Description& d) { return d; },
            "A copy, a description to be edited on its own.")
        .def("__copy__", [](const Description& d) { return d; })
        .def(
            "__deepcopy__", [](const Description& d, nb::handle) { return d; }, "memo"_a)
        .def("paths", &paths, "The paths of all objects and parameters, in order.")
        .def(
            "to_dict", [](const Description& d) { return DictWriter(d).scene(); },
            "The description as nested dicts, which load_dict() takes.")
        .def(
            "dump", [](const Description& d) { return dump(d); },
            "Canonical text: one line for each object and parameter. Equal for equal scenes, "
            "whatever "
            "they were read from.")
        .def(
            "save",
            [](const Description& d, nb::handle file, bool mitsuba) {
                const auto name =
                    nb::cast<std::string>(nb::module_::import_("os").attr("fspath")(file));
                for (const std::string& note : save(d, name, mitsuba))
                    if (PyErr_WarnEx(PyExc_UserWarning, note.c_str(), 1) != 0)
                        throw nb::python_error();
            },
            "file"_a, "mitsuba"_a = false,
            nb::sig("def save(self, file: str | os.PathLike[str], mitsuba: bool = False) -> None"),
            "Writes an .xml file of Mitsuba, which `etendue render` and load() read, and meshes "
            "and images to the folder NAME_files beside it.\n\n"
            "mitsuba: replaces plug-ins and parameters that Mitsuba 3 does not have, like `etendue "
            "convert`; a UserWarning names each replacement that changes the image.\n\n"
            "Raises ValueError for another extension, and RuntimeError if a file cannot be "
            "written.")
        .def_prop_ro(
            "file", [](const Description& d) { return d.file; },
            "The file that it was read from; \"dict\" for dicts without one.")
        .def_prop_ro(
            "warnings", [](const Description& d) { return d.warnings; },
            "What was left out or replaced by the reader, one sentence each.")
        .def(
            "build", &build, "resolution"_a.none() = nb::none(), "crop"_a.none() = nb::none(),
            "lenient"_a = false, "watertight"_a = false, "threads"_a = 0,
            "sensor"_a.none() = nb::none(),
            "Builds a Scene, which later edits do not change.\n\n"
            "resolution: (width, height) of the image in pixels, instead of the scene's.\n"
            "crop: (x, y, width, height) of the part to render, in pixels from the upper left "
            "corner.\n"
            "lenient: turns unknown plug-ins and parameters into warnings.\n"
            "watertight: lets no ray pass between adjacent triangles; slower.\n"
            "threads: number of threads; 0 for one per core.\n"
            "sensor: number (from 0) or name of the sensor; None: the first. See Scene.sensors.\n\n"
            "    scene = description.build(resolution=(320, 240), sensor=0)\n\n"
            "After an edit, meshes, images, and the hierarchy of rays that did not change are "
            "shared with the scene that this description, or the one that it is a copy of, built "
            "last. If a shape of the scene itself moves, the hierarchy is built again; if an "
            "instance moves, only the part above the groups. Files that have changed are read "
            "again. The scene is the same as if it were built from nothing.");

    nb::class_<SceneHandle>(
        m, "Scene",
        "A scene that is ready to render. It never changes: edit its Description "
        "and build another one.")
        .def_prop_ro(
            "file", [](const SceneHandle& s) { return s.scene.file(); },
            "The file that the description was read from; \"dict\" for dicts.")
        .def_prop_ro(
            "width", [](const SceneHandle& s) { return s.scene.film().crop_width; },
            "Width of the rendered part, in pixels.")
        .def_prop_ro(
            "height", [](const SceneHandle& s) { return s.scene.film().crop_height; },
            "Height of the rendered part, in pixels.")
        .def_prop_ro(
            "sensors", [](const SceneHandle& s) { return s.scene.sensor_names(); },
            "Names of the sensors of the description: their ids, or their types.")
        .def_prop_ro(
            "sensor", [](const SceneHandle& s) { return s.scene.sensor_index(); },
            "Number of the sensor that is rendered, an index into Scene.sensors.")
        .def_prop_ro(
            "shapes",
            [](const SceneHandle& s) {
                std::vector<std::string> names;
                for (const SceneShape& shape : s.scene.shapes()) names.push_back(shape.name);
                return names;
            },
            "Names of the shapes, their ids or their types, by the index that RayHits.shape has.")
        .def_prop_ro(
            "warnings", [](const SceneHandle& s) { return warnings_of(s.scene); },
            "What may be wrong with the scene, one sentence each.")
        .def_prop_ro(
            "bounds",
            [](const SceneHandle& s) {
                const Bounds3& b = s.scene.bounds();
                return std::array<std::array<float, 3>, 2>{
                    {{b.lo.x, b.lo.y, b.lo.z}, {b.hi.x, b.hi.y, b.hi.z}}};
            },
            "Corners of the bounding box, in scene units.")
        .def_prop_ro(
            "description", [](const SceneHandle& s) { return s.description; },
            "A copy of the description that the scene was built from.")
        .def("info", &info,
             "Counts, memory in bytes and emitted power in watts, as `etendue info`.")
        .def(
            "ray_intersect",
            [](nb::handle self, nb::handle origins, nb::handle directions,
               nb::handle max_distance) {
                return rays("intersect", self, origins, directions, max_distance);
            },
            "origins"_a, "directions"_a, "max_distance"_a = kInf,
            nb::sig("def ray_intersect(self, origins: numpy.typing.ArrayLike, directions: "
                    "numpy.typing.ArrayLike, max_distance: numpy.typing.ArrayLike = ...) -> "
                    "etendue._rays.RayHits"),
            "The first surfaces that rays hit, as RayHits.\n\n"
            "    hits = scene.ray_intersect((0, 1, 5), directions)     # directions: shape (N, 3)\n"
            "    nearest = hits.t.min()\n\n"
            "origins: in scene units, shape (..., 3). directions: of any length except 0, of the "
            "same "
            "shape, or of one that NumPy broadcasts.\n"
            "max_distance: longest distance in scene units, shape (...).\n\n"
            "A ray that begins on a surface may hit it again because of rounding: "
            "RayHits.origins() "
            "moves its origin. Of surfaces that are partly transparent (bsdf \"mask\"), the ray "
            "hits "
            "the one that leaves at most half of the light. Other Python threads continue. Raises "
            "ValueError for other shapes, and where a number is not finite.")
        .def(
            "occluded",
            [](nb::handle self, nb::handle origins, nb::handle directions,
               nb::handle max_distance) {
                return rays("occluded", self, origins, directions, max_distance);
            },
            "origins"_a, "directions"_a, "max_distance"_a = kInf,
            nb::sig("def occluded(self, origins: numpy.typing.ArrayLike, directions: "
                    "numpy.typing.ArrayLike, max_distance: numpy.typing.ArrayLike = ...) -> "
                    "numpy.typing.NDArray[numpy.bool_]"),
            "Whether rays hit anything within max_distance, shape (...). The arguments are those "
            "of "
            "ray_intersect().")
        .def_prop_ro(
            "crop_offset",
            [](const SceneHandle& s) {
                return std::pair(s.scene.film().crop_x, s.scene.film().crop_y);
            },
            "Position (x, y) of the rendered part in the whole image, in pixels.")
        .def(
            "bsdf",
            [](nb::handle self, nb::handle at, nb::handle uv) {
                return scattering("bsdf", self, at, uv);
            },
            "at"_a, "uv"_a = nb::make_tuple(0.5, 0.5),
            nb::sig("def bsdf(self, at: etendue._rays.RayHits | int | str, uv: "
                    "numpy.typing.ArrayLike = (0.5, 0.5)) -> etendue._scattering.Bsdfs"),
            "The materials at points of surfaces, as Bsdfs with eval(), pdf() and sample().\n\n"
            "    f = scene.bsdf(0).eval((0, 0, 1), directions)    # directions: shape (N, 3)\n\n"
            "at: hits of ray_intersect(), where directions are those of the scene; or the number "
            "or "
            "name of a shape, whose material is then seen in a frame of its own: z is the normal, "
            "x "
            "and y are the tangents along u and v.\n"
            "uv: texture coordinates in that frame, shape (..., 2).\n\n"
            "Raises ValueError for rays that hit nothing, and for shapes that are not there.")
        .def(
            "sensor_rays",
            [](nb::handle self, nb::handle film, nb::handle lens) {
                return scattering("sensor_rays", self, film, lens);
            },
            "film"_a.none() = nb::none(), "lens"_a = nb::make_tuple(0.5, 0.5),
            nb::sig("def sensor_rays(self, film: numpy.typing.ArrayLike | None = None, lens: "
                    "numpy.typing.ArrayLike = (0.5, 0.5)) -> etendue._scattering.SensorRays"),
            "Rays of the sensor through points of the film, as SensorRays.\n\n"
            "    rays = scene.sensor_rays()                       # through the centres of all "
            "pixels\n"
            "    hits = scene.ray_intersect(rays.origins, rays.directions)\n\n"
            "film: in pixels from the upper left corner of the whole image, shape (..., 2); the "
            "centre of the first pixel is (0.5, 0.5). None: the centres of the pixels of the "
            "rendered part, shape (H, W).\n"
            "lens: numbers in [0, 1) that choose the point of a finite lens, shape (..., 2).\n\n"
            "With these rays, the radiance that arrives along them is the value of the pixel. "
            "Raises "
            "ValueError for other shapes and for numbers that are not finite.")
        .def("_repr_html_", [](nb::handle self) { return html("scene_html", self); })
        .def("__repr__", [](const SceneHandle& s) {
            const FilmGeometry& film = s.scene.film();
            return fmt::format("<Scene {}, {} x {}, {} shapes, {} emitters>", s.scene.file(),
                               film.crop_width, film.crop_height, s.scene.shapes().size(),
                               s.scene.emitters().size());
        });

    m.def(
        "load",
        [](const std::string& file, const std::map<std::string, std::string>& defines,
           bool lenient) {
            const ReadOptions options = read_options(defines, lenient);
            nb::gil_scoped_release no_gil;
            return Description(read_scene_file(file, options));
        },
        "file"_a, "defines"_a, "lenient"_a);
    m.def(
        "load_string",
        [](const std::string& xml, const std::map<std::string, std::string>& defines,
           const std::string& name, bool lenient) {
            const ReadOptions options = read_options(defines, lenient);
            const nb::gil_scoped_release no_gil;
            return Description(parse_mitsuba_xml(xml, name, options));
        },
        "xml"_a, "defines"_a, "name"_a, "lenient"_a);
    m.def(
        "load_dict",
        [](nb::dict d, const std::string& folder, const std::string& file,
           std::vector<std::string> warnings) {
            Description scene;
            scene.file = file;
            scene.search_paths = {folder};
            scene.warnings = std::move(warnings);
            DictReader(scene, file).read_scene(d);
            return scene;
        },
        "d"_a, "folder"_a, "file"_a = "dict", "warnings"_a = nb::list());
    m.def(
        "plugins",
        [](const std::string& category, const std::string& name) {
            return to_json(choose_plugins(plugin_list(), category, name)).dump();
        },
        "category"_a, "name"_a);
    const auto vec = [](const std::array<float, 3>& v) { return Vec3{v[0], v[1], v[2]}; };
    m.def(
        "look_at",
        [vec](const std::array<float, 3>& origin, const std::array<float, 3>& target,
              const std::array<float, 3>& up) {
            return matrix(Transform::look_at(vec(origin), vec(target), vec(up)));
        },
        "origin"_a, "target"_a, "up"_a);
    m.def(
        "rotate",
        [vec](const std::array<float, 3>& axis, double degrees) {
            const Vec3 v = vec(axis);
            if (!(length2(v) > 0)) throw nb::value_error("the axis of a rotation must not be zero");
            return matrix(Transform::rotate(v, degrees));
        },
        "axis"_a, "degrees"_a);
}

}  // namespace etendue::python
