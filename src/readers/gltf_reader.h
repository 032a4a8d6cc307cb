#pragma once
// Implementation of gltf.h: one object reads one scene.

#include <map>
#include <string>
#include <vector>

#include "description/scene_description.h"
#include "math/bounds.h"
#include "readers/gltf_buffers.h"
#include "readers/gltf_json.h"
#include "readers/read_options.h"
#include "system/available_memory.h"

namespace etendue {

class GltfReader {
public:
    /// The arguments must outlive the reader. `chunk`: the binary chunk of a .glb file.
    GltfReader(const std::string& file, const ReadOptions& options, const nlohmann::json& document,
               std::string_view chunk);
    /// Reads the scene; to be called once.
    SceneDescription read();

private:
    /// What a material becomes.
    struct Material {
        int bsdf = -1;
        int emitter = -1;  ///< Emitter, of which each shape has its own copy; -1: none.
        int interior = -1;
        /// Numbers of the sets of texture coordinates that are used: at most two.
        std::vector<size_t> uv_sets;
    };
    /// What COLOR_0 of a primitive has; an alpha of one everywhere counts as none.
    enum class VertexColors { None, Rgb, Rgba };
    /// A mesh primitive in the description.
    struct Primitive {
        int64_t mesh;  ///< Index into SceneDescription::meshes.
        size_t material;
        VertexColors colors;
        Bounds3 bounds;
    };
    /// A mesh to be placed.
    struct Placement {
        size_t mesh;
        Transform to_world;
    };

    // Nodes, cameras and lights: gltf_reader.cpp.
    void check_extensions();
    void read_scene();
    void read_node(const JsonValue& node, const Transform& to_world);
    void check_gpu_instances() const;
    std::vector<Transform> gpu_instances(const JsonValue& node);
    void add_camera(const JsonValue& camera, const Transform& to_world);
    void add_default_camera();
    void add_light(const JsonValue& light, const Transform& to_world);
    int add_film(double aspect);

    // Meshes: gltf_meshes.cpp.
    void place_meshes();
    const std::vector<Primitive>& primitives(size_t mesh);
    std::optional<Primitive> read_primitive(const JsonValue& primitive, const std::string& name);
    int add_shape(const Primitive& primitive, const Transform& to_world, bool in_group);

    // Materials and textures: gltf_materials.cpp.
    const Material& material(size_t index, VertexColors colors);
    Material read_material(const JsonValue& m, VertexColors colors);
    void read_surface(const JsonValue& m, int surface, VertexColors colors);
    void read_specular(const JsonValue& m, const JsonValue& specular, int surface);
    void check_normals_of_coat(const JsonValue& m, const JsonValue& coat);
    void read_sheen(const JsonValue& cloth, int surface);
    void read_anisotropy(const JsonValue& brushed, int surface, double roughness,
                         const JsonValue& texture);
    int vertex_attribute(const char* name);
    int product(int a, int b);
    /// A factor, times a texture unless that is -1.
    struct Color {
        Rgb factor;
        int texture = -1;
    };
    Color base_color(const JsonValue& m, VertexColors colors);
    Color with_vertex_colors(const JsonValue& factor, const JsonValue& texture,
                             VertexColors colors);
    void set_color(int object, const char* name, const Color& color);
    void set_diffuse_and_specular(int surface, const Color& diffuse, const Color& specular,
                                  const JsonValue& where);
    void read_specular_glossiness(const JsonValue& s, int surface, VertexColors colors);
    void apply_opacity(const JsonValue& m, Material& made, VertexColors colors);
    /// The product of the factors of alpha; a constant where there is no texture.
    struct Alpha {
        int texture = -1;
        double factor = 1;
    };
    Alpha alpha(const JsonValue& m, VertexColors colors);
    void read_emission(const JsonValue& m, Material& made);
    void read_volume(const JsonValue& m, Material& made);
    /// The bitmap that a textureInfo names; -1 where it is absent.
    int bitmap(const JsonValue& info, bool raw, const char* channel = nullptr);
    /// Sets `name` of `object` to a factor, times the channel of a texture where there is one.
    void set_scalar(int object, const char* name, double factor, const JsonValue& texture,
                    const char* channel, bool raw = true);
    int scaled(int texture, ParamValue factor);
    /// Which of the mesh's two sets of texture coordinates a texture is a function of.
    int uv_set(const JsonValue& info);

    int add(const char* category, const char* type, const JsonValue& where);
    void set(int object, const char* name, ParamValue value);
    void add_child(int parent, const char* name, int object);
    void warn(const std::string& message);
    /// Fails where so many bytes more do not fit into the memory.
    void watch(size_t bytes, const JsonValue& where);
    /// An error, or a warning under `lenient`.
    void reject(const JsonValue& where, const std::string& message);

    const ReadOptions& options_;
    FileName file_;
    JsonValue root_;
    std::vector<JsonValue> nodes_, meshes_, materials_, textures_, images_, samplers_, cameras_,
        lights_;
    GltfBuffers buffers_;
    SceneDescription scene_;
    std::vector<bool> visited_;  ///< Nodes.
    std::vector<Placement> placements_;
    std::map<size_t, std::vector<Primitive>> primitives_;
    std::map<std::pair<size_t, VertexColors>, Material> made_materials_;
    std::map<size_t, int64_t> loaded_images_;  ///< Index into SceneDescription::images.
    std::vector<size_t> uv_sets_;              ///< Of the material that is being read.
    Bounds3 bounds_;
    MemoryWatch watch_;
    bool has_light_ = false, has_camera_ = false;
};

}  // namespace etendue
