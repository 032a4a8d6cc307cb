#include "readers/pbrt_reader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <utility>

#include <fmt/format.h>

#include "readers/file_bytes.h"
#include "readers/gzip.h"
#include "readers/mitsuba_values.h"
#include "readers/object_graph.h"

namespace etendue {
namespace {

// Far beyond any real scene; they keep hostile files from exhausting the stack, the time or the memory.
constexpr size_t kDeepestNesting = 4096, kDeepestInclude = 32;
constexpr int kMostIncludes = 10'000;

Vec3 read_vec3(PbrtTokenizer& in) {
    const float x = in.number<float>("a number"), y = in.number<float>("a number");
    return {x, y, in.number<float>("a number")};
}

/// Sixteen numbers by columns, between brackets.
Transform read_matrix(PbrtTokenizer& in) {
    const bool bracket = in.skip('[');
    Transform::Matrix m;
    for (size_t column = 0; column < 4; ++column)
        for (size_t row = 0; row < 4; ++row)
            m[row][column] = in.number<double>("one of a matrix's 16 numbers");
    if (bracket && !in.skip(']'))
        in.fail("a matrix has 16 numbers, here is a closing bracket missing after them");
    const Transform t(m);
    if (!t.is_invertible()) in.fail("the matrix is not invertible");
    return t;
}

/// World to camera: the camera at `eye` has its z axis toward `target`, x to the right.
Transform look_at_matrix(Vec3 eye, Vec3 target, Vec3 up, const PbrtTokenizer& in) {
    const Vec3 d = target - eye;
    if (!(length2(d) > 0))
        in.fail(fmt::format("LookAt needs two different points, but both are {} {} {}", eye.x,
                            eye.y, eye.z));
    const Vec3 z = normalize(d), x = cross(up, z);
    if (!(length(x) > 1e-6f * length(up)))
        in.fail(fmt::format("LookAt's up vector {} {} {} must not point along the view", up.x, up.y,
                            up.z));
    const Vec3 right = normalize(x), y = cross(z, right);
    return Transform(Transform::Matrix{{{right.x, y.x, z.x, eye.x},
                                        {right.y, y.y, z.y, eye.y},
                                        {right.z, y.z, z.z, eye.z},
                                        {0, 0, 0, 1}}})
        .inverse();
}

/// Of a rejected entry, whose description is "Rejected: because.".
std::string_view reason(std::string_view doc) {
    doc.remove_prefix(std::string_view("Rejected: ").size());
    doc.remove_suffix(1);
    return doc;
}

std::string normal_path(const std::string& path) {
    return std::filesystem::path(path).lexically_normal().string();
}

std::vector<std::string> names_of(const auto& map) {
    std::vector<std::string> names;
    for (const auto& [name, value] : map) names.push_back(name);
    return names;
}

}  // namespace

const std::vector<PbrtReader::Directive> PbrtReader::kDirectives = {
    {"Identity", kV3And4, Place::Anywhere, &PbrtReader::identity},
    {"Translate", kV3And4, Place::Anywhere, &PbrtReader::translate},
    {"Scale", kV3And4, Place::Anywhere, &PbrtReader::scale},
    {"Rotate", kV3And4, Place::Anywhere, &PbrtReader::rotate},
    {"LookAt", kV3And4, Place::Anywhere, &PbrtReader::look_at},
    {"Transform", kV3And4, Place::Anywhere, &PbrtReader::transform},
    {"ConcatTransform", kV3And4, Place::Anywhere, &PbrtReader::concat_transform},
    {"CoordinateSystem", kV3And4, Place::Anywhere, &PbrtReader::coordinate_system},
    {"CoordSysTransform", kV3And4, Place::Anywhere, &PbrtReader::coord_sys_transform},
    {"ActiveTransform", kV3And4, Place::Anywhere, &PbrtReader::active_transform},
    {"TransformTimes", kV3And4, Place::Options, &PbrtReader::transform_times},
    {"TransformBegin", kV3And4, Place::World, &PbrtReader::transform_begin},
    {"TransformEnd", kV3And4, Place::World, &PbrtReader::transform_end},
    {"AttributeBegin", kV3And4, Place::World, &PbrtReader::attribute_begin},
    {"AttributeEnd", kV3And4, Place::World, &PbrtReader::attribute_end},
    {"Attribute", kV4, Place::Anywhere, &PbrtReader::attribute},
    {"ReverseOrientation", kV3And4, Place::World, &PbrtReader::reverse_orientation},
    {"MediumInterface", kV3And4, Place::Anywhere, &PbrtReader::medium_interface},
    {"MakeNamedMedium", kV3And4, Place::Anywhere, &PbrtReader::make_named_medium},
    {"Texture", kV3And4, Place::World, &PbrtReader::texture},
    {"Material", kV3And4, Place::World, &PbrtReader::material},
    {"MakeNamedMaterial", kV3And4, Place::World, &PbrtReader::make_named_material},
    {"NamedMaterial", kV3And4, Place::World, &PbrtReader::named_material},
    {"LightSource", kV3And4, Place::World, &PbrtReader::light_source},
    {"AreaLightSource", kV3And4, Place::World, &PbrtReader::area_light_source},
    {"Shape", kV3And4, Place::World, &PbrtReader::shape},
    {"ObjectBegin", kV3And4, Place::World, &PbrtReader::object_begin},
    {"ObjectEnd", kV3And4, Place::World, &PbrtReader::object_end},
    {"ObjectInstance", kV3And4, Place::World, &PbrtReader::object_instance},
    {"Include", kV3And4, Place::Anywhere, &PbrtReader::include},
    {"Import", kV4, Place::World, &PbrtReader::import},
    {"Camera", kV3And4, Place::Options, &PbrtReader::camera},
    {"Film", kV3And4, Place::Options, &PbrtReader::film},
    {"PixelFilter", kV3And4, Place::Options, &PbrtReader::pixel_filter},
    {"Sampler", kV3And4, Place::Options, &PbrtReader::sampler},
    {"Integrator", kV3And4, Place::Options, &PbrtReader::integrator},
    {"Accelerator", kV3And4, Place::Options, &PbrtReader::accelerator},
    {"Option", kV4, Place::Options, &PbrtReader::option},
    {"ColorSpace", kV4, Place::Anywhere, &PbrtReader::color_space},
    {"WorldBegin", kV3And4, Place::Options, &PbrtReader::world_begin},
    {"WorldEnd", kV3, Place::World, &PbrtReader::world_end},
};

SceneDescription PbrtReader::read(std::string_view text) {
    scene_.version = ends_with_world_end(text) ? PbrtVersion::V3 : PbrtVersion::V4;
    read_file(text, scene_.description.file);
    finish({scene_.description.file, 0});
    return std::move(scene_.description);
}

// ---- Files and directives

void PbrtReader::read_file(std::string_view text, const std::string& path) {
    const size_t outer = std::exchange(first_open_, open_files_.size());
    open_files_.push_back({path, {}});
    PbrtTokenizer in(plain_text(text, path), file_names_.emplace_back(path));
    while (const char c = in.peek()) {
        close_files(in);
        if (c == '"')
            in.fail(fmt::format("expected a directive, found the string {}", quote(in.string())));
        if (c == '[' || c == ']') in.fail(fmt::format("expected a directive, found \"{}\"", c));
        const std::string_view word = in.word();
        read_directive(in, word);
    }
    open_files_.resize(first_open_);
    first_open_ = outer;
}

void PbrtReader::close_files(const PbrtTokenizer& in) {
    open_files_.resize(std::min(open_files_.size(), first_open_ + 1 + in.depth()));
}

void PbrtReader::read_directive(PbrtTokenizer& in, std::string_view word) {
    if (world_ended_) in.fail(fmt::format("{} after WorldEnd, which must be the last", word));
    const auto it = std::find_if(kDirectives.begin(), kDirectives.end(),
                                 [&](const Directive& d) { return word == d.name; });
    if (it == kDirectives.end()) {
        std::vector<std::string> known;
        for (const Directive& d : kDirectives)
            if (d.versions & int(scene_.version)) known.emplace_back(d.name);
        in.fail(fmt::format("unknown directive {}{}", quote(word), hint(word, known)));
    }
    if (it->place == Place::Options && in_world_)
        in.fail(fmt::format("{} must stand before WorldBegin", word));
    if (it->place == Place::World && !in_world_)
        in.fail(fmt::format("{} must stand after WorldBegin", word));
    if (!(it->versions & int(scene_.version)))
        in.fail(fmt::format("{} is a directive of pbrt-v{}, but this is a scene of pbrt-v{}", word,
                            it->versions == kV3 ? 3 : 4, scene_.is_v3() ? 3 : 4));
    (this->*it->read)(in);
    for (; !ready_.empty(); ready_.pop_front()) make_waiting(std::move(ready_.front()), true);
}

/// pbrt includes text: the parameters of a directive may go on behind the Include of the file in which it begins.
void PbrtReader::include(PbrtTokenizer& in) {
    OpenFile file = load_included(in);
    const FileName& name = file_names_.emplace_back(file.path);
    open_files_.push_back(std::move(file));
    in.include(plain_text(open_files_.back().text, name.str()), name);
}

/// What is imported is complete, and its graphics state ends with it.
void PbrtReader::import(PbrtTokenizer& in) {
    const OpenFile file = load_included(in);
    const PbrtState state = scene_.state;
    const size_t outer = std::exchange(first_saved_, stack_.size());
    read_file(file.text, file.path);
    check_all_closed();
    first_saved_ = outer;
    scene_.state = state;
}

PbrtReader::OpenFile PbrtReader::load_included(PbrtTokenizer& in) {
    const PbrtPlace where = in.where();
    const std::string name = unescape(in.string());
    close_files(in);
    if (++includes_ > kMostIncludes)
        throw SceneError(where,
                         fmt::format("the scene includes more than {} files", kMostIncludes));
    if (open_files_.size() > kDeepestInclude)
        throw SceneError(
            where, fmt::format("files include each other more than {} deep", kDeepestInclude));
    std::string path;
    std::string text = scene_.load(name, where, path);
    if (is_gzip(text)) text = unpack_gzip(text, path);
    for (const OpenFile& open : open_files_)
        if (normal_path(open.path) == normal_path(path))
            throw SceneError(where, fmt::format("{} includes itself", quote(path)));
    return {std::move(path), std::move(text)};
}

PbrtArguments PbrtReader::arguments(PbrtTokenizer& in, const char* kind, const char* defaults) {
    const PbrtPlace where = in.where();
    std::string name = unescape(in.string());
    PbrtArguments args(kind, std::move(name), where, read_pbrt_values(in));
    if (const auto it = scene_.state.defaults.find(defaults); it != scene_.state.defaults.end())
        args.add_defaults(*it->second);
    return args;
}

int PbrtReader::make(PbrtArguments& args, const std::vector<PbrtEntry>& table,
                     const std::string& stand_in) {
    const int version = int(scene_.version);
    const auto it = std::find_if(table.begin(), table.end(), [&](const PbrtEntry& e) {
        return args.name() == e.name && (e.versions & version);
    });
    if (it == table.end()) {
        std::vector<std::string> known;
        for (const PbrtEntry& e : table)
            if ((e.versions & version) && !e.name.empty()) known.emplace_back(e.name);
        const std::string what = fmt::format("unknown {} {}", args.kind(), quote(args.name()));
        if (!scene_.options.lenient)
            throw SceneError(args.where(), what + hint(args.name(), known));
        scene_.refuse(args.where(), what, stand_in);
        return -1;
    }
    if (!it->make) {
        scene_.refuse(args.where(),
                      fmt::format("{} {}: {}", args.kind(), quote(args.name()), reason(it->doc)),
                      stand_in);
        return -1;
    }
    args.check(*it, scene_.version,
               [&](const SourceLocation& where, const std::string& what, const std::string& more) {
                   scene_.reject(where, what, more);
               });
    return it->make(scene_, args);
}

// ---- Names that are defined later

std::string PbrtReader::missing_name(const PbrtArguments& args, bool is_shape) const {
    if (scene_.is_v3()) return {};
    for (const PbrtValue& v : args.values()) {
        if (v.type == PbrtType::Texture)
            for (const std::string& name : v.strings)
                if (!scene_.float_textures.contains(name) &&
                    !scene_.spectrum_textures.contains(name))
                    return "texture " + name;
        if (v.name == "materials")  // of a mixture
            for (const std::string& name : v.strings)
                if (!scene_.named_materials.contains(name)) return "material " + name;
    }
    const std::string& material = scene_.state.named_material.str();
    return is_shape && !material.empty() && !scene_.named_materials.contains(material)
               ? "material " + material
               : "";
}

void PbrtReader::make_when_defined(PbrtArguments args, bool is_shape,
                                   std::function<void(PbrtArguments&)> make) {
    if (missing_name(args, is_shape).empty()) return make(args);
    make_waiting({++order_, scene_.state, scene_.group, is_shape, std::move(args), std::move(make)},
                 true);
}

void PbrtReader::make_waiting(Waiting what, bool may_wait) {
    PbrtState state = std::exchange(scene_.state, what.state);
    const int group = std::exchange(scene_.group, what.group);
    if (std::string name = may_wait ? missing_name(what.args, what.is_shape) : ""; !name.empty())
        waiting_[std::move(name)].push_back(std::move(what));
    else
        what.make(what.args);
    scene_.state = std::move(state);
    scene_.group = group;
}

void PbrtReader::make_all_waiting() {
    std::map<int, Waiting> in_order;
    for (auto& [name, all] : waiting_)
        for (Waiting& w : all) in_order.emplace(w.order, std::move(w));
    for (auto& [order, w] : in_order) make_waiting(std::move(w), false);
}

// ---- Transforms

void PbrtReader::identity(PbrtTokenizer&) {
    scene_.state.ctm = Transform();
}

void PbrtReader::translate(PbrtTokenizer& in) {
    scene_.state.ctm = scene_.state.ctm * Transform::translate(read_vec3(in));
}

void PbrtReader::scale(PbrtTokenizer& in) {
    const Vec3 s = read_vec3(in);
    if (!(s.x != 0 && s.y != 0 && s.z != 0))
        in.fail(
            fmt::format("the factors of Scale must not be zero, but are {} {} {}", s.x, s.y, s.z));
    scene_.state.ctm = scene_.state.ctm * Transform::scale(s);
}

void PbrtReader::rotate(PbrtTokenizer& in) {
    const double degrees = in.number<double>("an angle");
    const Vec3 axis = read_vec3(in);
    if (!(length2(axis) > 0)) in.fail("the axis of Rotate must not be zero");
    scene_.state.ctm = scene_.state.ctm * Transform::rotate(axis, degrees);
}

void PbrtReader::look_at(PbrtTokenizer& in) {
    const Vec3 eye = read_vec3(in), target = read_vec3(in), up = read_vec3(in);
    scene_.state.ctm = scene_.state.ctm * look_at_matrix(eye, target, up, in);
}

void PbrtReader::transform(PbrtTokenizer& in) {
    scene_.state.ctm = read_matrix(in);
}

void PbrtReader::concat_transform(PbrtTokenizer& in) {
    scene_.state.ctm = scene_.state.ctm * read_matrix(in);
}

void PbrtReader::coordinate_system(PbrtTokenizer& in) {
    coordinate_systems_[unescape(in.string())] = scene_.state.ctm;
}

void PbrtReader::coord_sys_transform(PbrtTokenizer& in) {
    const PbrtPlace where = in.where();
    const std::string name = unescape(in.string());
    const auto it = coordinate_systems_.find(name);
    if (it == coordinate_systems_.end())
        throw SceneError(where, fmt::format("there is no coordinate system {}{}", quote(name),
                                            hint(name, names_of(coordinate_systems_))));
    scene_.state.ctm = it->second;
}

void PbrtReader::active_transform(PbrtTokenizer& in) {
    const PbrtPlace where = in.where();
    const std::string which(in.word());
    if (which != "All" && which != "StartTime" && which != "EndTime")
        throw SceneError(where,
                         fmt::format("expected All, StartTime or EndTime, found {}", quote(which)));
    if (which != "All")
        scene_.refuse(where, "motion is not supported (ActiveTransform)",
                      "transforms hold for all times");
}

void PbrtReader::transform_times(PbrtTokenizer& in) {
    in.number<float>("a time");
    in.number<float>("a time");
}

// ---- Attributes

void PbrtReader::push(const char* what, PbrtPlace where) {
    if (stack_.size() >= kDeepestNesting)
        throw SceneError(where, fmt::format("{} nests more than {} deep", what, kDeepestNesting));
    stack_.push_back({what, where, scene_.state, hidden_.size()});
}

void PbrtReader::pop(const char* what, const char* closing, PbrtPlace where) {
    if (stack_.size() == first_saved_)
        throw SceneError(where, fmt::format("{} without {}", closing, what));
    const Saved& last = stack_.back();
    if (std::string_view(last.what) != what)
        throw SceneError(where,
                         fmt::format("{}, but the last thing opened is the {} at {}:{}", closing,
                                     last.what, last.where.file->str(), last.where.line));
}

void PbrtReader::restore() {
    scene_.state = std::move(stack_.back().state);
    for (; hidden_.size() > stack_.back().hidden; hidden_.pop_back()) {
        const HiddenName& last = hidden_.back();
        if (last.object)
            (*last.names)[last.name] = *last.object;
        else
            last.names->erase(last.name);
    }
    stack_.pop_back();
}

void PbrtReader::check_all_closed() const {
    if (stack_.size() > first_saved_)
        throw SceneError(stack_.back().where,
                         fmt::format("{} is never closed", stack_.back().what));
}

void PbrtReader::define(std::map<std::string, int>& names, const std::string& name, int object) {
    const auto [it, is_new] = names.try_emplace(name, object);
    if (scene_.is_v3() && !stack_.empty())
        hidden_.push_back({&names, name, is_new ? std::nullopt : std::optional(it->second)});
    it->second = object;
    const char* kind = &names == &scene_.named_materials ? "material " : "texture ";
    if (const auto waiting = waiting_.find(kind + name); waiting != waiting_.end()) {
        std::move(waiting->second.begin(), waiting->second.end(), std::back_inserter(ready_));
        waiting_.erase(waiting);
    }
}

void PbrtReader::attribute_begin(PbrtTokenizer& in) {
    push("AttributeBegin", in.where());
}

void PbrtReader::attribute_end(PbrtTokenizer& in) {
    pop("AttributeBegin", "AttributeEnd", in.where());
    restore();
}

void PbrtReader::transform_begin(PbrtTokenizer& in) {
    push("TransformBegin", in.where());
}

void PbrtReader::transform_end(PbrtTokenizer& in) {
    pop("TransformBegin", "TransformEnd", in.where());
    scene_.state.ctm = stack_.back().state.ctm;
    stack_.pop_back();
}

void PbrtReader::attribute(PbrtTokenizer& in) {
    const PbrtPlace where = in.where();
    const std::string target = unescape(in.string());
    const std::vector<std::string> known = {"shape", "light", "material", "medium", "texture"};
    if (std::find(known.begin(), known.end(), target) == known.end())
        throw SceneError(where, fmt::format("unknown target of Attribute {}{}", quote(target),
                                            hint(target, known)));
    PbrtArguments merged("Attribute", target, where, read_pbrt_values(in));
    std::shared_ptr<const std::vector<PbrtValue>>& defaults = scene_.state.defaults[target];
    if (defaults) merged.add_defaults(*defaults);
    if (merged.values().size() > kMostPbrtValues)
        throw SceneError(where, fmt::format("Attribute {} has more than {} parameters",
                                            quote(target), kMostPbrtValues));
    defaults = std::make_shared<const std::vector<PbrtValue>>(merged.values());
}

void PbrtReader::reverse_orientation(PbrtTokenizer&) {
    scene_.state.reverse_orientation = !scene_.state.reverse_orientation;
}

void PbrtReader::color_space(PbrtTokenizer& in) {
    const PbrtPlace where = in.where();
    const std::string name = unescape(in.string());
    if (name != "srgb")
        scene_.refuse(
            where, fmt::format("the colour space {} is not supported (known: srgb)", quote(name)),
            "\"srgb\"");
}

// ---- Media, textures, materials

void PbrtReader::medium_interface(PbrtTokenizer& in) {
    const PbrtPlace where = in.where();
    scene_.state.inside = PbrtName(unescape(in.string()));
    scene_.state.outside = in.peek() == '"' ? PbrtName(unescape(in.string())) : scene_.state.inside;
    if (!in_world_ && !scene_.state.outside.empty())
        scene_.reject(where, "a medium around the camera is not supported");
}

PbrtArguments PbrtReader::take_type(PbrtArguments args, const char* kind) {
    const PbrtValue* type = args.find("type");
    if (!type || type->type != PbrtType::String || type->strings.size() != 1)
        args.fail(fmt::format("{} {} needs a \"string type\"", args.kind(), quote(args.name())));
    std::string name = type->strings[0];
    std::vector<PbrtValue> values = args.values();
    std::erase_if(values, [](const PbrtValue& v) { return v.name == "type"; });
    return {kind, std::move(name), args.where(), std::move(values)};
}

void PbrtReader::make_named_medium(PbrtTokenizer& in) {
    const PbrtArguments args = arguments(in, "MakeNamedMedium", "medium");
    PbrtArguments typed = take_type(args, "medium");
    scene_.media[args.name()] = make(typed, pbrt_media(), "vacuum");
}

void PbrtReader::texture(PbrtTokenizer& in) {
    const PbrtPlace where = in.where();
    const std::string name = unescape(in.string()), type = unescape(in.string());
    const bool is_float = type == "float";
    if (!is_float && type != "spectrum" && type != "color")
        throw SceneError(
            where, fmt::format("a texture is of the type float or spectrum, not {}", quote(type)));
    PbrtArguments args = arguments(in, is_float ? "float Texture" : "spectrum Texture", "texture");
    make_when_defined(std::move(args), false, [this, name, is_float](PbrtArguments& a) {
        int object = make(a, pbrt_textures(), "a constant of 0.5");
        if (object < 0) {
            object = scene_.add("texture", "constant", a.where());
            scene_.set(object, "value", Rgb(0.5f));
        }
        define(is_float ? scene_.float_textures : scene_.spectrum_textures, name, object);
    });
}

int PbrtReader::make_material(PbrtArguments& args) {
    const int object = make(args, pbrt_materials(), "a grey diffuse one");
    if (object >= 0) return object;
    PbrtArguments grey(args.kind(), scene_.is_v3() ? "matte" : "diffuse", args.where(), {});
    return make(grey, pbrt_materials(), "");
}

void PbrtReader::material(PbrtTokenizer& in) {
    PbrtArguments args = arguments(in, "Material", "material");
    scene_.state.named_material = {};
    if (missing_name(args, false).empty()) {
        scene_.state.material = make_material(args);
        return;
    }
    // Shapes wait for it under a name that no file has.
    const std::string name = fmt::format("{}material {}", '\0', order_);
    scene_.state.named_material = name;
    make_when_defined(std::move(args), false, [this, name](PbrtArguments& a) {
        define(scene_.named_materials, name, make_material(a));
    });
}

void PbrtReader::make_named_material(PbrtTokenizer& in) {
    const PbrtArguments args = arguments(in, "MakeNamedMaterial", "material");
    make_when_defined(take_type(args, "Material"), false,
                      [this, name = args.name()](PbrtArguments& a) {
                          define(scene_.named_materials, name, make_material(a));
                      });
}

void PbrtReader::named_material(PbrtTokenizer& in) {
    scene_.state.material_where = in.where();
    const std::string name = unescape(in.string());
    if (scene_.is_v3()) {
        scene_.state.material = scene_.named_material(name, scene_.state.material_where);
        return;
    }
    scene_.state.named_material = name;
    // pbrt-v4 may define the material later.
    if (!scene_.named_materials.contains(name))
        not_yet_made_.emplace_back(name, scene_.state.material_where);
}

// ---- Lights and shapes

void PbrtReader::light_source(PbrtTokenizer& in) {
    PbrtArguments args = arguments(in, "LightSource", "light");
    make(args, pbrt_lights(), "no light");
}

void PbrtReader::area_light_source(PbrtTokenizer& in) {
    PbrtArguments args = arguments(in, "AreaLightSource", "light");
    const auto& table = pbrt_area_lights();
    const auto it = std::find_if(table.begin(), table.end(), [&](const PbrtEntry& e) {
        return args.name() == e.name && (e.versions & int(scene_.version));
    });
    if (it == table.end())
        throw SceneError(args.where(), fmt::format("unknown AreaLightSource {} (known: diffuse)",
                                                   quote(args.name())));
    args.check(*it, scene_.version,
               [&](const SourceLocation& where, const std::string& what, const std::string& more) {
                   scene_.reject(where, what, more);
               });
    scene_.state.area_light = std::make_shared<const PbrtArguments>(std::move(args));
}

void PbrtReader::shape(PbrtTokenizer& in) {
    make_when_defined(arguments(in, "Shape", "shape"), true,
                      [this](PbrtArguments& a) { make(a, pbrt_shapes(), "nothing"); });
}

void PbrtReader::object_begin(PbrtTokenizer& in) {
    const PbrtPlace where = in.where();
    const std::string name = unescape(in.string());
    if (scene_.group >= 0)
        throw SceneError(where, "objects cannot be nested: ObjectBegin before ObjectEnd");
    if (scene_.objects.contains(name))
        throw SceneError(where, fmt::format("there is an object {} already", quote(name)));
    push("ObjectBegin", where);
    scene_.group = scene_.add("shape", "shapegroup", where);
    scene_.objects[name] = scene_.group;
}

void PbrtReader::object_end(PbrtTokenizer& in) {
    pop("ObjectBegin", "ObjectEnd", in.where());
    restore();
    scene_.group = -1;
}

void PbrtReader::object_instance(PbrtTokenizer& in) {
    const PbrtPlace where = in.where();
    const std::string name = unescape(in.string());
    if (scene_.group >= 0) throw SceneError(where, "an object cannot hold an instance");
    const auto it = scene_.objects.find(name);
    if (it == scene_.objects.end())
        throw SceneError(where, fmt::format("there is no object {}{}", quote(name),
                                            hint(name, names_of(scene_.objects))));
    const int instance = scene_.add("shape", "instance", where);
    scene_.set(instance, "to_world", scene_.state.ctm);
    scene_.add_child(instance, "", it->second);
    scene_.description.roots.push_back(instance);
}

// ---- The view

void PbrtReader::camera(PbrtTokenizer& in) {
    camera_ = arguments(in, "Camera");
    camera_from_world_ = scene_.state.ctm;
    coordinate_systems_["camera"] = scene_.state.ctm.inverse();
}

void PbrtReader::film(PbrtTokenizer& in) {
    film_ = arguments(in, "Film");
    // The one name that tells the versions apart where the end of the file did not.
    if (film_.name() == "image") scene_.version = PbrtVersion::V3;
}

void PbrtReader::pixel_filter(PbrtTokenizer& in) {
    filter_ = arguments(in, "PixelFilter");
}

void PbrtReader::sampler(PbrtTokenizer& in) {
    sampler_ = arguments(in, "Sampler");
}

void PbrtReader::integrator(PbrtTokenizer& in) {
    integrator_ = arguments(in, "Integrator");
}

void PbrtReader::accelerator(PbrtTokenizer& in) {
    arguments(in, "Accelerator");
}

void PbrtReader::option(PbrtTokenizer& in) {
    read_pbrt_values(in);
}

void PbrtReader::world_begin(PbrtTokenizer& in) {
    make_view();
    in_world_ = true;
    scene_.state.ctm = Transform();
    coordinate_systems_["world"] = scene_.state.ctm;
    scene_.state.inside = scene_.state.outside = {};
    (void)in;
}

void PbrtReader::world_end(PbrtTokenizer&) {
    world_ended_ = true;
}

void PbrtReader::make_view() {
    const bool v3 = scene_.is_v3();
    const PbrtPlace start{&file_names_.front(), 0};
    const auto complete = [&](PbrtArguments& args, const char* kind,
                              const char* fallback) -> PbrtArguments& {
        if (args.kind().empty()) args = {kind, fallback, start, {}};
        return args;
    };
    // The film first: the camera asks for its size, and lights for its exposure.
    scene_.camera_to_world = camera_from_world_.inverse();
    scene_.film = make(complete(film_, "Film", v3 ? "image" : "rgb"), pbrt_films(), "\"rgb\"");
    if (scene_.film < 0) {
        PbrtArguments rgb("Film", v3 ? "image" : "rgb", start, {});
        scene_.film = make(rgb, pbrt_films(), "");
    }
    scene_.filter = make(complete(filter_, "PixelFilter", v3 ? "box" : "gaussian"), pbrt_filters(),
                         "a gaussian");
    scene_.sampler = make(complete(sampler_, "Sampler", v3 ? "halton" : "zsobol"), pbrt_samplers(),
                          "16 samples a pixel");
    scene_.integrator = make(complete(integrator_, "Integrator", v3 ? "path" : "volpath"),
                             pbrt_integrators(), "\"path\"");
    scene_.sensor =
        make(complete(camera_, "Camera", "perspective"), pbrt_cameras(), "a perspective camera");
    if (scene_.sensor < 0) {
        PbrtArguments pinhole("Camera", "perspective", camera_.where(), {});
        scene_.sensor = make(pinhole, pbrt_cameras(), "");
    }
    if (scene_.filter >= 0) scene_.add_child(scene_.film, "", scene_.filter);
    scene_.add_child(scene_.sensor, "", scene_.film);
    if (scene_.sampler >= 0) scene_.add_child(scene_.sensor, "", scene_.sampler);
    scene_.description.roots.push_back(scene_.sensor);
    if (scene_.integrator >= 0) scene_.description.roots.push_back(scene_.integrator);
}

void PbrtReader::finish(const SourceLocation& end) {
    if (!in_world_) throw SceneError(end, "the scene has no WorldBegin");
    check_all_closed();
    for (const auto& [name, where] : not_yet_made_) scene_.named_material(name, where);
    make_all_waiting();
    std::erase_if(scene_.description.roots, [&](int root) {
        const SceneObject& o = scene_.object(root);
        return o.type == "instance" && scene_.object(o.children[0].object).children.empty();
    });
    constexpr int kDeepestObjects = 64;
    check_object_graph(scene_.description, kDeepestObjects);
}

}  // namespace etendue
