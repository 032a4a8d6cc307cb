#pragma once
// What the directives of a pbrt file build: the description, the graphics state, the names given so far.

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "readers/pbrt_arguments.h"
#include "readers/read_options.h"
#include "system/available_memory.h"

namespace etendue {

/// A name whose copies share the text.
using PbrtName = FileName;

/// What AttributeBegin saves and AttributeEnd restores. Copies share what can be large, since files nest deeply.
struct PbrtState {
    Transform ctm;
    bool reverse_orientation = false;
    int material = -1;        ///< Object, -1 for the default one.
    PbrtName named_material;  ///< Instead, where it is not empty.
    PbrtPlace material_where;
    std::shared_ptr<const PbrtArguments> area_light;
    PbrtName inside, outside;  ///< Media.
    /// pbrt-v4's Attribute: parameters that hold for every shape, light, ... that follows.
    std::map<std::string, std::shared_ptr<const std::vector<PbrtValue>>> defaults;
};

class PbrtScene {
public:
    PbrtScene(const std::string& file, const ReadOptions& options);

    bool is_v3() const { return version == PbrtVersion::V3; }

    /// A new object, which nothing refers to yet.
    int add(const char* category, const char* type, SourceLocation where);
    void set(int object, const char* name, ParamValue value);
    void add_child(int parent, const char* name, int object);
    const SceneObject& object(int index) const { return description.objects[size_t(index)]; }

    /// Colour of a parameter; `fallback` where it is absent.
    Rgb colour(const PbrtArguments& args, std::string_view name, Rgb fallback,
               PbrtSpectrum kind) const;
    /// The same of a float, or of a texture that is constant; nothing where a real texture is given.
    std::optional<Rgb> constant(const PbrtArguments& args, std::string_view name, Rgb fallback,
                                PbrtSpectrum kind) const;
    std::optional<float> constant(const PbrtArguments& args, std::string_view name,
                                  float fallback) const;
    /// The texture object that a parameter names; -1 where it is absent or no texture.
    int texture(const PbrtArguments& args, std::string_view name, bool is_float) const;
    /// Whether a parameter is a number, or a texture of which there is one of floats or none.
    bool is_float(const PbrtArguments& args, std::string_view name) const;
    /// Gives parameter `to` of an object the value of `name`: colour, number or texture.
    void bind(int object, const char* to, const PbrtArguments& args, const char* name, Rgb fallback,
              PbrtSpectrum kind = PbrtSpectrum::Albedo);
    void bind_float(int object, const char* to, const PbrtArguments& args, const char* name,
                    float fallback);

    /// Contents of a file whose name stands in the scene, and its path.
    std::string load(const std::string& name, const SourceLocation& where, std::string& path) const;
    /// An error, or under `lenient` a warning that something was dropped.
    void reject(const SourceLocation& where, const std::string& what, const std::string& more = "");
    /// An error, or under `lenient` a warning that `stand_in` takes its place.
    void refuse(const SourceLocation& where, const std::string& what, const std::string& stand_in);
    void warn(const SourceLocation& where, const std::string& message);

    /// The object of a named material; `where` is where it is named.
    int named_material(const std::string& name, const SourceLocation& where) const;
    /// What a shape shows: the current material, made where none was given.
    int current_material();
    /// Adds a shape of the current group or of the scene, with its material and emitter.
    void place_shape(int shape, const PbrtArguments& args);

    SceneDescription description;
    MemoryWatch watch;  ///< Over what a short text makes much of.
    const ReadOptions& options;
    PbrtVersion version = PbrtVersion::V4;
    PbrtState state;
    std::map<std::string, int> float_textures, spectrum_textures, named_materials;
    std::map<std::string, int> objects;  ///< Shapegroups by name.
    std::map<std::string, int> media;    ///< -1: vacuum.
    int group = -1;                      ///< Shapegroup that is being filled.
    /// The view, of which the parts are given in any order before WorldBegin.
    int film = -1, filter = -1, sampler = -1, sensor = -1, integrator = -1;
    int film_width = 0, film_height = 0;
    Transform camera_to_world;
    /// Factor of every light: what the film does with what the sensor sees.
    float exposure = 1;

private:
    int default_material_ = -1;
    std::map<std::pair<int, int>, int> masked_;  ///< By material and alpha texture.
};

/// The tables of what each directive may name.
const std::vector<PbrtEntry>& pbrt_shapes();
const std::vector<PbrtEntry>& pbrt_materials();
const std::vector<PbrtEntry>& pbrt_textures();
const std::vector<PbrtEntry>& pbrt_lights();
const std::vector<PbrtEntry>& pbrt_area_lights();
const std::vector<PbrtEntry>& pbrt_media();
const std::vector<PbrtEntry>& pbrt_cameras();
const std::vector<PbrtEntry>& pbrt_films();
const std::vector<PbrtEntry>& pbrt_filters();
const std::vector<PbrtEntry>& pbrt_samplers();
const std::vector<PbrtEntry>& pbrt_integrators();

}  // namespace etendue
