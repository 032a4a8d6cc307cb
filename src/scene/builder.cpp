#include "scene/builder.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "description/resolve_file.h"
#include "film/filter.h"
#include "film/thread_arena.h"
#include "scene/built_parts.h"
#include "scene/model_builder.h"
#include "scene/plugin_lookup.h"
#include "scene/preload.h"
#include "scene/settings.h"
#include "scene/shape_registry.h"

namespace etendue {

/// Traverses a description from its roots and fills a Scene.
class SceneBuilder {
public:
    SceneBuilder(const SceneDescription& description, const BuildOptions& options)
        : description_(description), options_(options), plugins_(description, options.lenient),
          earlier_(options_.earlier), models_(plugins_),
          preload_(description, models_.images(), earlier_.get()) {}

    Scene build() {
        scene_.file_ = description_.file;
        is_child_.resize(description_.objects.size());
        for (const SceneObject& object : description_.objects)
            for (const auto& c : object.children) is_child_[size_t(c.object)] = true;
        for (int root : description_.roots) add_root(root);
        for (const View& v : views_)
            for (const auto& c : plugins_.params(v.sensor).children("medium"))
                models_.make_medium(c.object);
        take_models();
        if (scene_.shapes_.empty() && scene_.owned_->emitters.empty())
            throw SceneError({description_.file, 0}, "the scene has no shapes and no emitters");
        finish_geometry();
        make_sensor(choose_sensor());
        scene_.warnings_ = plugins_.warnings();
        finish_emitters();
        count();
        return std::move(scene_);
    }

    /// What the scene that was built shares with the next one.
    std::shared_ptr<const BuiltParts> parts(const Scene& scene) {
        auto parts = std::make_shared<BuiltParts>();
        parts->description = description_;
        parts->shapes = preload_.take_all();
        parts->images = scene.owned_->images->images();
        parts->layout = std::move(layout_);
        parts->accelerator = accelerator_;
        return parts;
    }

private:
    /// A camera of the file; one in a `batch` may have the film of the batch.
    struct View {
        int sensor;
        int batch = -1;
        int batch_size = 1;
    };

    /// An object of the scene itself. What others refer to may stand there for that reason alone.
    void add_root(int root) {
        const SceneObject& object = description_.objects[size_t(root)];
        const std::string& c = object.category;
        const bool is_child = is_child_[size_t(root)];
        if (c == "shape")
            add_shape(root);
        else if (c == "bsdf" || c == "texture" || c == "medium")
            check_unused(root);
        else if (is_child)
            return;
        else if (c == "emitter")
            models_.make_emitters(root);
        else if (c == "sensor")
            add_sensor(root);
        else if (c == "integrator")
            read_integrator(root);
        else
            plugins_.warn(object.where, fmt::format("the {} \"{}\" is not used", c, object.type));
    }

    void add_sensor(int index) {
        if (description_.objects[size_t(index)].type != "batch") {
            views_.push_back({index});
            return;
        }
        const auto nested = plugins_.params(index).children("sensor");
        for (const auto& c : nested) views_.push_back({c.object, index, int(nested.size())});
    }

    /// The view that the options select.
    View choose_sensor() {
        if (views_.empty()) throw SceneError({description_.file, 0}, "the scene has no sensor");
        for (const View& v : views_) {
            const SceneObject& o = description_.objects[size_t(v.sensor)];
            scene_.sensor_names_.push_back(o.id.empty() ? o.type : o.id);
        }
        const auto& names = scene_.sensor_names_;
        const std::string& wanted = options_.sensor;
        size_t& index = scene_.sensor_index_;
        if (wanted.empty()) {
            if (views_.size() > 1)
                plugins_.warn(
                    description_.objects[size_t(views_[1].sensor)].where,
                    fmt::format("the scene has {} sensors ({}); the first is used, and --sensor "
                                "selects another one",
                                views_.size(), fmt::join(names, ", ")));
            return views_[0];
        }
        index = size_t(std::find(names.begin(), names.end(), wanted) - names.begin());
        if (index == names.size()) {
            const auto [end, error] =
                std::from_chars(wanted.data(), wanted.data() + wanted.size(), index);
            if (error != std::errc() || end != wanted.data() + wanted.size() ||
                index >= names.size())
                throw SceneError(
                    {description_.file, 0},
                    fmt::format("there is no sensor \"{}\" (known: 0 to {}, or by name: {})",
                                wanted, names.size() - 1, fmt::join(names, ", ")));
        }
        return views_[index];
    }

    void take_models() {
        Models models = models_.take(strict_normals_);
        scene_.owned_->images = std::move(models.images);
        scene_.owned_->textures = std::move(models.textures);
        scene_.owned_->materials = std::move(models.materials);
        scene_.owned_->images_of_materials = std::move(models.images_of_materials);
        scene_.owned_->emitters = std::move(models.emitters);
        scene_.media_ = std::move(models.media);
    }

    /// Checks a top-level material, texture or medium, even if no shape uses it.
    void check_unused(int index) {
        const std::string& c = description_.objects[index].category;
        if (c == "bsdf")
            models_.make_material(index);
        else if (c == "texture")
            models_.make_texture(index);
        else
            models_.make_medium(index);
    }

    void read_media(const Params& p, SceneShape& s) {
        for (const auto& c : p.children("medium")) {
            if (c.name == "interior")
                s.interior = models_.make_medium(c.object);
            else if (c.name == "exterior")
                s.exterior = models_.make_medium(c.object);
            else {
                plugins_.problem(c.where,
                                 fmt::format("a shape's medium must be named \"interior\" or "
                                             "\"exterior\", not \"{}\"",
                                             c.name));
                continue;
            }
            s.is_interface = true;
        }
    }

    /// A shape with its material, emitter and media, not yet added to the accelerator.
    std::optional<SceneShape> make_shape(int index, bool in_group) {
        const ShapeEntry* entry = plugins_.find(index, shape_registry());
        if (!entry) return {};
        const Params p = plugins_.params(index);
        SceneShape s;
        auto made = plugins_.attempt(index, [&] {
            auto shape = preload_.take_shape(
                *entry, p, [&](const std::string& m) { plugins_.warn(p.where(), m); });
            check_extent(shape->bounds(), p.where());
            return shape;
        });
        if (!made) return {};
        scene_.owned_->shapes.push_back(std::move(made));
        s.shape = scene_.owned_->shapes.back().get();
        s.is_mesh = dynamic_cast<const TriangleMesh*>(s.shape) != nullptr;
        s.name = p.object().id.empty() ? p.object().type : p.object().id;
        const auto materials = p.children("bsdf");
        if (materials.size() > 1)
            plugins_.problem(materials[1].where,
                             "a shape can have only one bsdf; this is a second");
        const auto emitters = p.children("emitter");
        if (emitters.size() > 1)
            plugins_.problem(emitters[1].where,
                             "a shape can have only one emitter; this is a second");
        if (const auto dipoles = p.children("subsurface"); !dipoles.empty())
            plugins_.problem(dipoles[0].where, "scattering below the surface is not supported");
        s.material = materials.empty()
                         ? models_.default_material(emitters.empty() ? Rgb(0.5f) : Rgb(0))
                         : models_.make_material(materials[0].object);
        s.needs_tangents = !materials.empty() && s.material->needs_tangents();
        if (!materials.empty()) s.images = models_.images_of(materials[0].object);
        read_media(p, s);
        if (!s.material->is_opaque()) {
            scene_.has_masks_ = true;
            scene_.has_open_boundaries_ |= s.is_interface;
        }
        if (emitters.empty()) return s;
        const SourceLocation& where = emitters[0].where;
        if (!materials.empty() && is_invisible(materials[0].object))
            plugins_.problem(where, "an emitter on a shape with bsdf \"null\" is not supported: "
                                    "what no ray meets emits nothing");
        else if (in_group)
            plugins_.problem(where, "an emitter in a shapegroup is not supported (add the shape to "
                                    "the scene instead)");
        else
            s.emitter = models_.make_emitters(emitters[0].object, s.shape, s.material);
        return s;
    }
    /// Whether a material is `null`, perhaps within others.
    bool is_invisible(int bsdf) const {
        const auto inner = plugins_.params(bsdf).children("bsdf");
        return plugins_.object(bsdf).type == "null" ||
               (inner.size() == 1 && is_invisible(inner[0].object));
    }

    /// The squares of distances must be numbers of single precision.
    static void check_extent(const Bounds3& b, const SourceLocation& where) {
        constexpr float kFarthest = 1e18f;
        for (const Vec3 corner : {b.lo, b.hi})
            for (const float x : {corner.x, corner.y, corner.z})
                if (!(std::fabs(x) <= kFarthest))
                    throw SceneError(
                        where, fmt::format("shapes must lie within ±1e18, but one reaches {}", x));
    }

    void add_shape(int index) {
        const SceneObject& object = description_.objects[size_t(index)];
        if (object.type == "shapegroup") {
            plugins_.check(index, group_infos()[0]);
            make_group(index);
        } else if (object.type == "instance") {
            for (const Instance& i : instances_of(index)) instances_.push_back(i);
        } else if (object.type == "merge") {
            plugins_.check(index, group_infos()[2]);
            for (const auto& c : plugins_.params(index).children("shape")) add_shape(c.object);
        } else if (auto s = make_shape(index, false)) {
            top_.push_back(*s);
            scene_.shapes_.push_back(*s);  // finish_geometry() sets the order
        }
    }

    /// Shapes of the accelerator, by index in `groups_`, under a transform.
    struct Instance {
        size_t group;
        Transform to_world;
    };

    /// What an `instance` shows; empty under `lenient` where there is nothing to show.
    std::vector<Instance> instances_of(int index) {
        plugins_.check(index, group_infos()[1]);
        const Params p = plugins_.params(index);
        const auto groups = p.children("shape");
        if (groups.size() != 1 || plugins_.object(groups[0].object).type != "shapegroup") {
            plugins_.problem(
                p.where(),
                fmt::format("an instance needs exactly one reference to a shapegroup, "
                            "but contains {} shape{}{}",
                            groups.size(), groups.size() == 1 ? "" : "s",
                            groups.size() == 1
                                ? fmt::format(", a \"{}\"", plugins_.object(groups[0].object).type)
                                : ""));
            return {};
        }
        const std::vector<Instance>& group = make_group(groups[0].object);
        count_copies(group.size(), p.where());
        std::vector<Instance> shown = group;
        const Transform to_world = plugins_.attempt(index, [&] { return p.transform("to_world"); });
        for (Instance& i : shown) {
            i.to_world = to_world * i.to_world;
            check_size(i.to_world, p.where());
        }
        return shown;
    }

    /// Embree inverts the matrices of instances in float, by their determinants.
    static void check_size(const Transform& to_world, const SourceLocation& where) {
        constexpr double kLeast = 1e-12;
        const double size = std::cbrt(std::fabs(to_world.determinant3()));
        if (!(size >= kLeast))
            throw SceneError(where,
                             fmt::format("an instance must not be smaller than {} of its group, "
                                         "but the scale of this one is {:.3g}",
                                         kLeast, size));
    }

    /// Groups within groups multiply, so that a short file could fill any memory. Instances of groups that hold shapes
    /// only are not limited.
    void count_copies(size_t parts, const SourceLocation& where) {
        constexpr size_t kMostCopies = 1 << 22;
        if (parts > 1) copies_ += parts;
        if (copies_ > kMostCopies)
            throw SceneError(where, fmt::format("nested groups amount to more than {} instances: "
                                                "put their shapes into fewer groups",
                                                kMostCopies));
    }

    /// The shapes of a group, and the instances nested in it.
    const std::vector<Instance>& make_group(int index) {
        if (const auto it = group_of_.find(index); it != group_of_.end()) return it->second;
        std::vector<SceneShape> members;
        std::vector<Instance> parts;
        fill_group(index, members, parts);
        if (!members.empty()) {
            groups_.push_back(std::move(members));
            parts.push_back({groups_.size() - 1, Transform()});
        }
        if (parts.empty())
            plugins_.problem(plugins_.object(index).where, "the shapegroup has no shapes");
        return group_of_[index] = std::move(parts);
    }

    void fill_group(int index, std::vector<SceneShape>& members, std::vector<Instance>& parts) {
        for (const auto& c : plugins_.params(index).children("shape")) {
            const std::string& type = plugins_.object(c.object).type;
            if (type == "shapegroup" || type == "instance") {
                if (type == "shapegroup")
                    count_copies(make_group(c.object).size(), plugins_.object(c.object).where);
                const auto nested =
                    type == "instance" ? instances_of(c.object) : make_group(c.object);
                parts.insert(parts.end(), nested.begin(), nested.end());
            } else if (type == "merge") {
                fill_group(c.object, members, parts);
            } else if (auto s = make_shape(c.object, true)) {
                members.push_back(*s);
            }
        }
    }

    void finish_geometry() {
        scene_.shapes_ = top_;
        const auto member = [](const SceneShape& s) {
            return Accelerator::Member{s.shape, !s.material->is_opaque()};
        };
        std::ranges::transform(top_, std::back_inserter(layout_.top), member);
        for (const auto& group : groups_) {
            std::ranges::transform(group, std::back_inserter(layout_.groups.emplace_back()),
                                   member);
            scene_.shapes_.insert(scene_.shapes_.end(), group.begin(), group.end());
        }
        for (const auto& [group, to_world] : instances_)
            layout_.instances.emplace_back(group, to_world);
        layout_.is_watertight = options_.accelerator.is_watertight;
        const auto add_bounds = [&](const SceneShape& s, const Bounds3& bounds, uint32_t instance) {
            scene_.bounds_.extend(bounds);
            if (!may_be_in_chain(s) || s.shape->primitive_count() == 0) return;
            scene_.may_have_chains_ |= s.material->may_have_delta();
            if (!s.material->may_be_smooth())
                scene_.clear_shapes_.push_back(
                    {s.shape, instance, bounds.center(), bounds.radius()});
        };
        for (const SceneShape& s : top_) add_bounds(s, s.shape->bounds(), kNoInstance);
        uint32_t instance = 0;
        for (const auto& [group, to_world] : instances_) {
            for (const SceneShape& s : groups_[group]) {
                const Bounds3 b = s.shape->bounds();
                Bounds3 world;
                for (int corner = 0; corner < 8; ++corner)
                    world.extend(
                        to_world.point({corner & 1 ? b.hi.x : b.lo.x, corner & 2 ? b.hi.y : b.lo.y,
                                        corner & 4 ? b.hi.z : b.lo.z}));
                add_bounds(s, world, instance);
            }
            ++instance;
        }
        if (!scene_.bounds_.is_empty()) check_extent(scene_.bounds_, {description_.file, 0});
        plugins_.guarded(0, [&] { accelerator_ = make_accelerator(); });
        scene_.owned_->accelerator = *accelerator_;
    }

    /// The earlier one, if it has the same shapes in the same places.
    Accelerator make_accelerator() const {
        if (earlier_ && earlier_->layout == layout_) return *earlier_->accelerator;
        Accelerator a = earlier_ ? Accelerator(options_.accelerator, *earlier_->accelerator)
                                 : Accelerator(options_.accelerator);
        for (const Accelerator::Member& m : layout_.top) a.add_shape(m);
        std::vector<uint32_t> ids;
        for (const auto& members : layout_.groups) ids.push_back(a.add_group(members));
        for (const auto& [group, to_world] : layout_.instances)
            a.add_instance(ids[group], to_world);
        a.commit();
        return a;
    }

    void finish_emitters() {
        Bounds3 bounds = scene_.bounds_;
        bounds.extend(scene_.sensor_->lens_bounds());
        const float radius = std::max(bounds.radius(), 1e-6f);
        for (auto& e : scene_.owned_->emitters) {
            // The margin keeps bounding discs outside all objects.
            e->set_scene_bounds(bounds.is_empty() ? Vec3{} : bounds.center(), radius * 1.001f);
            if (e->is_infinite() && !e->is_delta()) scene_.infinite_.push_back(e.get());
            scene_.has_delta_emitters_ |= e->is_delta();
            scene_.has_large_emitter_tables_ |= e->has_large_tables();
        }
        if (scene_.has_media()) find_media();
        scene_.selection_ = AliasTable(selection_weights());
        for (size_t i = 0; i < scene_.owned_->emitters.size(); ++i) {
            Emitter& e = *scene_.owned_->emitters[i];
            e.index = uint32_t(i);
            if (!scene_.selection_.empty()) e.selection_pmf = scene_.selection_.pmf(e.index);
        }
        if (scene_.selection_.empty())
            scene_.warnings_.push_back(
                "no emitter of the scene has any power: the image will be black");
    }

    /// Weights of the choice of emitters, see Scene::sample_emitter().
    std::vector<double> selection_weights() const {
        std::vector<double> weights;
        double finite = 0, infinite = 0;
        for (const auto& e : scene_.owned_->emitters) {
            weights.push_back(e->power());
            (e->is_infinite() ? infinite : finite) += weights.back();
        }
        if (!(finite > 0 && infinite > 0)) return weights;
        // The power from infinity is that through the disc of the whole scene. A distant object makes it as large as
        // one likes, a large lamp far off the power of finite emitters.
        constexpr double kLeastShare = 0.25;
        const double share =
            std::clamp(infinite / (finite + infinite), kLeastShare, 1 - kLeastShare);
        for (size_t i = 0; i < weights.size(); ++i)
            weights[i] *=
                scene_.owned_->emitters[i]->is_infinite() ? share / infinite : (1 - share) / finite;
        return weights;
    }

    /// The media in which emitters and the sensor lie.
    void find_media() {
        std::map<const Emitter*, const SceneShape*> boundaries;
        for (const SceneShape& s : scene_.shapes_)
            if (s.emitter && s.is_interface) boundaries[s.emitter] = &s;
        for (auto& e : scene_.owned_->emitters) {
            if (const auto it = boundaries.find(e.get()); it != boundaries.end()) {
                e->medium = it->second->exterior;
                e->medium_behind = it->second->interior;
            } else if (!e->is_infinite()) {
                e->medium = e->medium_behind = medium_of(*e);
            }
        }
        if (!scene_.sensor_->is_orthographic()) {
            const FilmGeometry& film = scene_.film_;
            const Vec2 center{float(film.width) / 2, float(film.height) / 2};
            scene_.sensor_medium_ =
                scene_.medium_around({scene_.sensor_->sample_ray(center, {0.5f, 0.5f}).p});
        }
        if (sensor_medium_ && *sensor_medium_ != scene_.sensor_medium_)
            plugins_.problem(where_of_sensor_medium_,
                             "the medium around the sensor is not the one that the surfaces around "
                             "it have on their side",
                             "the one of the surfaces instead");
    }

    /// The medium at points all over an emitter.
    MediumId medium_of(const Emitter& emitter) const {
        const auto medium_at = [&](FinePoint u) {
            const EmissionSample e = emitter.sample_emission(u, {0.5f, 0.5f});
            return scene_.medium_around(emitter.is_area() ? RayEnd{e.p, e.ng, emitter.slack(e.prim)}
                                                          : RayEnd{e.p});
        };
        const MediumId medium = medium_at({0.5, 0.5});
        if (!emitter.is_area()) return medium;
        // A lattice, since the first number also chooses the primitive.
        constexpr int kPoints = 64, kGenerator = 39;
        for (int i = 0; i < kPoints; ++i)
            if (medium_at({stratum(i, kPoints, 0.5),
                           stratum(i * kGenerator % kPoints, kPoints, 0.5)}) != medium)
                return kSeveralMedia;
        return medium;
    }

    /// The integrator is kept as it is. It is checked where it is used, since the command line may name another one.
    void read_integrator(int index) {
        RenderDefaults& defaults = scene_.defaults_;
        if (defaults.integrator)
            return plugins_.problem(plugins_.object(index).where,
                                    "a scene can have only one integrator; this is a second");
        defaults.is_lenient = options_.lenient;
        index = unwrapped_integrator(index);
        SceneObject& kept = defaults.integrator.emplace(plugins_.object(index));
        kept.children.clear();
        for (Param& param : kept.params) {
            if (const bool* strict = param.as<bool>(); strict && param.name == "strict_normals")
                strict_normals_ = *strict;
            if (param.name != "user_paths" || !param.as<std::string>()) continue;
            try {
                param.value = resolve_file(plugins_.params(index), param.name);
            } catch (const SceneError& e) {
                defaults.integrator_problem = e.what();
            }
        }
    }

    /// The integrator itself, or the innermost one of wrappers; `path` where they are empty.
    int unwrapped_integrator(int index) {
        const Params p = plugins_.params(index);
        const std::string& type = p.object().type;
        const IntegratorAlias* alias = find_integrator_alias(type);
        if (!alias || *alias->integrator) return index;
        const auto nested = p.children("integrator");
        plugins_.warn(p.where(),
                      nested.empty()
                          ? fmt::format("integrator \"{}\" is rendered by path", type)
                          : fmt::format("integrator \"{}\" is not supported; the one within it, "
                                        "\"{}\", is rendered",
                                        type, plugins_.object(nested[0].object).type));
        return nested.empty() ? index : unwrapped_integrator(nested[0].object);
    }

    void make_sensor(const View& view) {
        const int index = view.sensor;
        const SensorEntry* entry = plugins_.find(index, sensor_registry());
        if (!entry)
            throw SceneError(description_.objects[size_t(index)].where,
                             "the sensor is unknown and cannot be left out");
        const Params p = plugins_.params(index);
        FilmGeometry film{.width = 768, .height = 576, .crop_width = 768, .crop_height = 576};
        auto films = p.children("film");
        const bool has_film_of_batch = films.empty() && view.batch >= 0;
        if (has_film_of_batch) films = plugins_.params(view.batch).children("film");
        if (films.size() > 1)
            plugins_.problem(films[1].where, "a sensor can have only one film; this is a second");
        scene_.filter_ = default_filter();
        if (!films.empty()) {
            if (const FilmEntry* f = plugins_.find(films[0].object, film_registry()))
                film = f->make(plugins_.params(films[0].object));
            for (const auto& c : plugins_.params(films[0].object).children("rfilter"))
                if (const FilterEntry* r = plugins_.find(c.object, filter_registry()))
                    scene_.filter_ = r->make(plugins_.params(c.object));
        }
        if (has_film_of_batch) {  // whose views stand side by side
            film.width = std::max(film.width / view.batch_size, 1);
            film.crop_x = film.crop_y = 0;
            film.crop_width = film.width;
            film.crop_height = film.height;
        }
        apply_overrides(film, p);
        for (const auto& c : p.children("sampler"))
            if (plugins_.find(c.object, sampler_registry()))
                scene_.defaults_.spp =
                    int(plugins_.params(c.object).integer("sample_count", 4, 1, 1 << 30));
        if (const auto media = p.children("medium"); !media.empty()) {
            sensor_medium_ = models_.make_medium(media[0].object);
            where_of_sensor_medium_ = media[0].where;
        }
        scene_.film_ = film;
        scene_.sensor_ = plugins_.guarded(index, [&] {
            return entry->make(p, {film, scene_.filter_.radius(), scene_.bounds_.radius(),
                                   scene_.bounds_.center()});
        });
    }

    void apply_overrides(FilmGeometry& film, const Params& sensor) const {
        if (options_.resolution) {
            const auto [w, h] = *options_.resolution;
            film = {.width = w, .height = h, .crop_width = w, .crop_height = h};
        }
        if (options_.crop) {
            const auto [x, y, w, h] = *options_.crop;
            if (x < 0 || y < 0 || w < 1 || h < 1 || w > film.width - x || h > film.height - y)
                throw SceneError(
                    sensor.where(),
                    fmt::format("the crop of {} x {} pixels at ({}, {}) does not lie within the "
                                "image of {} x {}",
                                w, h, x, y, film.width, film.height));
            film.crop_x = x, film.crop_y = y, film.crop_width = w, film.crop_height = h;
        }
        // Numbers of light paths have 30 bits.
        if (film.pixel_count() > uint64_t(1) << 30)
            throw SceneError(
                sensor.where(),
                fmt::format("an image of {} x {} pixels is too large: the limit is 2^30 "
                            "pixels; render it in crops",
                            film.crop_width, film.crop_height));
    }

    void count() {
        Scene::Statistics& st = scene_.statistics_;
        for (const SceneShape& s : scene_.shapes_) {
            (s.is_mesh ? st.triangles : st.quadrics) += s.shape->primitive_count();
            st.geometry_bytes += s.shape->memory_bytes();
        }
        st.instances = instances_.size();
        st.materials = scene_.owned_->materials.size();
        st.textures = scene_.owned_->textures.size();
        for (const auto& t : scene_.owned_->textures) st.texture_bytes += t->memory_bytes();
        st.texture_bytes += scene_.owned_->images->memory_bytes();
        st.accelerator_bytes = scene_.owned_->accelerator.memory_bytes();
    }

    const SceneDescription& description_;
    BuildOptions options_;
    PluginLookup plugins_;
    std::shared_ptr<const BuiltParts> earlier_;
    ModelBuilder models_;
    Preload preload_;
    Scene scene_;
    std::map<int, std::vector<Instance>> group_of_;
    size_t copies_ = 0;           ///< Of what groups within groups contain.
    std::vector<bool> is_child_;  ///< Whether another object refers to an object.
    std::vector<View> views_;
    std::optional<MediumId> sensor_medium_;  ///< As the file gives it.
    SourceLocation where_of_sensor_medium_;
    bool strict_normals_ = false;
    std::vector<SceneShape> top_;
    std::vector<std::vector<SceneShape>> groups_;
    std::vector<Instance> instances_;
    AcceleratorLayout layout_;
    std::optional<Accelerator> accelerator_;
};

Scene build_scene(const SceneDescription& description, const BuildOptions& options) {
    // Embree, too, uses the threads of the arena that calls it.
    ThreadArena arena(options.threads);
    return arena.execute([&] { return SceneBuilder(description, options).build(); });
}

BuiltScene build_scene_again(const SceneDescription& description, const BuildOptions& options) {
    ThreadArena arena(options.threads);
    return arena.execute([&] {
        SceneBuilder builder(description, options);
        Scene scene = builder.build();
        auto parts = builder.parts(scene);
        return BuiltScene{std::move(scene), std::move(parts)};
    });
}

std::vector<PluginInfo> scene_plugins() {
    std::vector<PluginInfo> all;
    auto add = [&](const auto& registry) {
        for (const auto& entry : registry) all.push_back(entry.info);
    };
    add(shape_registry());
    all.insert(all.end(), group_infos().begin(), group_infos().end());
    add(material_registry());
    add(texture_registry());
    add(emitter_registry());
    all.push_back(medium_info());
    add(sensor_registry());
    add(film_registry());
    add(filter_registry());
    add(sampler_registry());
    return all;
}

}  // namespace etendue
