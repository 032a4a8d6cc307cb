// Scenes of glTF: values of all kinds, materials, placement, and messages that name the place in the file.

#include "readers/gltf.h"

#include <cstring>

#include <gtest/gtest.h>

#include "error_of.h"

namespace etendue {
namespace {

/// The binary file of a test scene.
class Bytes {
public:
    template <class T>
    Bytes& add(std::initializer_list<T> values) {
        for (const T v : values) {
            char raw[sizeof(T)];
            std::memcpy(raw, &v, sizeof(T));
            bytes_.append(raw, sizeof(T));
        }
        return *this;
    }
    const std::string& str() const { return bytes_; }

private:
    std::string bytes_;
};

/// Four corners of a square (48 bytes), and the indices of its two triangles (12 bytes).
Bytes square() {
    Bytes b;
    b.add<float>({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}).add<uint16_t>({0, 1, 2, 0, 2, 3});
    return b;
}

const std::string kSquareAccessors =
    R"("accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":4},
       {"bufferView":1,"componentType":5123,"type":"SCALAR","count":6}],
       "bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":12}])";

std::string document(const Bytes& bytes, const std::string& rest) {
    return R"({"asset":{"version":"2.0"},"buffers":[{"uri":"b.bin","byteLength":)" +
           std::to_string(bytes.str().size()) + "}]," + rest + "}";
}

SceneDescription read(const std::string& json, const Bytes& bytes = {}, bool lenient = false) {
    ReadOptions options;
    options.lenient = lenient;
    options.read_file = [&](const std::string& path) -> std::optional<std::string> {
        if (path == "b.bin") return bytes.str();
        return {};
    };
    return parse_gltf(json, "s.gltf", options);
}

std::string error_of(const std::string& json, const Bytes& bytes = {}) {
    return test::error_of([&] { read(json, bytes); });
}

/// A square with this material.
SceneDescription with_material(const std::string& material, const std::string& more = "") {
    const Bytes b = square();
    return read(document(b, kSquareAccessors +
                                R"(,"nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":
        {"POSITION":0},"indices":1,"material":0}]}],"materials":[)" +
                                material + "]" + more),
                b);
}

const SceneObject& find_type(const SceneDescription& scene, const std::string& type) {
    for (const SceneObject& o : scene.objects)
        if (o.type == type) return o;
    throw std::runtime_error("there is no " + type);
}

template <class T>
T value_of(const SceneObject& o, const char* name) {
    const Param* p = o.find(name);
    if (!p) throw std::runtime_error(std::string("there is no ") + name);
    const T* v = p->as<T>();
    if (!v) throw std::runtime_error(std::string(name) + " has another type");
    return *v;
}

/// The texture of a parameter.
const SceneObject& texture_of(const SceneDescription& scene, const SceneObject& o,
                              const char* name) {
    for (const auto& c : o.children)
        if (c.name == name) return scene.objects[size_t(c.object)];
    throw std::logic_error(std::string("no texture ") + name);
}

void expect_no_warning_of_materials(const SceneDescription& scene) {
    for (const std::string& w : scene.warnings) EXPECT_EQ(w.find("/materials"), w.npos) << w;
}

TEST(Gltf, ReadsASquare) {
    const SceneDescription scene = with_material(
        R"({"pbrMetallicRoughness":{"baseColorFactor":[0.1,0.2,0.3,1],"metallicFactor":0.25,
            "roughnessFactor":0.5},"extensions":{"KHR_materials_ior":{"ior":1.25}}})");
    ASSERT_EQ(scene.meshes.size(), 1u);
    EXPECT_EQ(scene.meshes[0]->positions[2], (Vec3{1, 1, 0}));
    EXPECT_EQ(scene.meshes[0]->triangles[1], (MeshData::Triangle{0, 2, 3}));
    const SceneObject& m = find_type(scene, "openpbr");
    EXPECT_EQ(value_of<Rgb>(m, "base_color"), Rgb(0.1f, 0.2f, 0.3f));
    EXPECT_EQ(value_of<double>(m, "base_metalness"), 0.25);
    EXPECT_EQ(value_of<double>(m, "specular_roughness"), 0.5);
    EXPECT_NEAR(value_of<double>(m, "specular_ior"), 1.25, 1e-9);
    // Without camera and light.
    EXPECT_EQ(find_type(scene, "constant").category, "emitter");
    EXPECT_EQ(find_type(scene, "perspective").category, "sensor");
}

TEST(Gltf, StripsAndFansHaveTheSameSides) {
    const Bytes b = square();
    for (const auto& [mode, expected] :
         {std::pair{5, MeshData::Triangle{2, 1, 3}}, {6, MeshData::Triangle{2, 3, 0}}}) {
        const SceneDescription scene =
            read(document(b, kSquareAccessors +
                                 R"(,"nodes":[{"mesh":0}],"meshes":[{"primitives":[{"mode":)" +
                                 std::to_string(mode) + R"(,"attributes":{"POSITION":0}}]}])"),
                 b);
        ASSERT_EQ(scene.meshes[0]->triangles.size(), 2u);
        EXPECT_EQ(scene.meshes[0]->triangles[1], expected);
    }
}

TEST(Gltf, IntegersAreFractionsWhereNormalized) {
    Bytes b = square();
    b.add<uint8_t>({0, 51, 255, 0, 255, 0, 102, 0})
        .add<int16_t>({0, 0, 32767, 0, 0, 32767, -32768, 0, 0, 32767, 0, 0});
    const SceneDescription scene = read(
        document(b, R"("accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":4},
            {"bufferView":1,"componentType":5123,"type":"SCALAR","count":6},
            {"bufferView":2,"componentType":5121,"type":"VEC2","count":4,"normalized":true},
            {"bufferView":3,"componentType":5122,"type":"VEC3","count":4,"normalized":true}],
            "bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":12},
            {"buffer":0,"byteOffset":60,"byteLength":8},{"buffer":0,"byteOffset":68,"byteLength":24}],
            "nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":2,
            "NORMAL":3,"COLOR_0":3},"indices":1}]}])"),
        b);
    const MeshData& mesh = scene.meshes[0];
    EXPECT_FLOAT_EQ(mesh.uvs[0].y, 0.2f);
    EXPECT_FLOAT_EQ(mesh.uvs[3].x, 0.4f);
    EXPECT_FLOAT_EQ(mesh.colors[0].z, 1);
    EXPECT_FLOAT_EQ(mesh.normals[2].x, -1);
    EXPECT_EQ(find_type(scene, "mesh_attribute").category, "texture");
}

TEST(Gltf, SparseAccessorsReplaceValues) {
    Bytes b = square();
    b.add<uint8_t>({2}).add<uint8_t>({0, 0, 0}).add<float>({5, 6, 7});
    const SceneDescription scene = read(
        document(b, R"("accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":4,
            "sparse":{"count":1,"indices":{"bufferView":2,"componentType":5121},"values":{"bufferView":3}}},
            {"bufferView":1,"componentType":5123,"type":"SCALAR","count":6}],
            "bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":12},
            {"buffer":0,"byteOffset":60,"byteLength":1},{"buffer":0,"byteOffset":64,"byteLength":12}],
            "nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}])"),
        b);
    EXPECT_EQ(scene.meshes[0]->positions[2], (Vec3{5, 6, 7}));
    EXPECT_EQ(scene.meshes[0]->positions[1], (Vec3{1, 0, 0}));
}

TEST(Gltf, NodesMultiplyFromTheRootAndSharedMeshesAreInstances) {
    const Bytes b = square();
    const SceneDescription scene =
        read(document(b, kSquareAccessors + R"(,"scene":0,"scenes":[{"nodes":[0]}],"nodes":[
            {"translation":[1,0,0],"scale":[2,2,2],"children":[1,2]},{"mesh":0,"translation":[3,0,0]},
            {"mesh":0,"rotation":[0,0,1,0]}],
            "meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}])"),
             b);
    std::vector<Vec3> origins, ends;
    for (const SceneObject& o : scene.objects)
        if (o.type == "instance") {
            origins.push_back(value_of<Transform>(o, "to_world").point({0, 0, 0}));
            ends.push_back(value_of<Transform>(o, "to_world").point({1, 0, 0}));
        }
    EXPECT_EQ(origins, (std::vector<Vec3>{{7, 0, 0}, {1, 0, 0}}));
    EXPECT_EQ(ends[1], (Vec3{-1, 0, 0}));
    EXPECT_EQ(scene.meshes.size(), 1u);
}

TEST(Gltf, GpuInstancesArePlaced) {
    Bytes b = square();
    b.add<float>({1, 0, 0, 0, 5, 0});
    const SceneDescription scene = read(
        document(b, R"("accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":4},
            {"bufferView":1,"componentType":5123,"type":"SCALAR","count":6},
            {"bufferView":2,"componentType":5126,"type":"VEC3","count":2}],
            "bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":12},
            {"buffer":0,"byteOffset":60,"byteLength":24}],"nodes":[{"mesh":0,"extensions":
            {"EXT_mesh_gpu_instancing":{"attributes":{"TRANSLATION":2}}}}],
            "meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}])"),
        b);
    int count = 0;
    for (const SceneObject& o : scene.objects) count += o.type == "instance";
    EXPECT_EQ(count, 2);
}

TEST(Gltf, ExtensionsOfMaterialsSetTheirParameters) {
    const SceneDescription scene = with_material(
        R"({"emissiveFactor":[1,0.5,0],"extensions":{"KHR_materials_emissive_strength":{"emissiveStrength":4},
            "KHR_materials_transmission":{"transmissionFactor":0.75},
            "KHR_materials_volume":{"thicknessFactor":1,"attenuationDistance":2,"attenuationColor":[0.5,1,1]},
            "KHR_materials_clearcoat":{"clearcoatFactor":0.3,"clearcoatRoughnessFactor":0.1},
            "KHR_materials_sheen":{"sheenColorFactor":[0.2,0.4,0.2],"sheenRoughnessFactor":0.3},
            "KHR_materials_anisotropy":{"anisotropyStrength":0.6}},
            "pbrMetallicRoughness":{"roughnessFactor":0.5}})");
    const SceneObject& m = find_type(scene, "openpbr");
    EXPECT_EQ(value_of<double>(m, "transmission_weight"), 0.75);
    EXPECT_EQ(value_of<Rgb>(m, "transmission_color"), Rgb(1));
    EXPECT_FALSE(m.find("thin_walled"));
    EXPECT_EQ(value_of<double>(m, "coat_weight"), 0.3);
    EXPECT_EQ(value_of<double>(m, "coat_roughness"), 0.1);
    EXPECT_EQ(value_of<double>(m, "coat_ior"), 1.5);
    EXPECT_EQ(value_of<double>(m, "coat_affect_ior"), 0);
    EXPECT_EQ(value_of<double>(m, "coat_affect_roughness"), 0);
    EXPECT_NEAR(value_of<double>(m, "fuzz_weight"), 0.4, 1e-6);
    EXPECT_EQ(value_of<Rgb>(m, "fuzz_color"), Rgb(0.5f, 1, 0.5f));
    EXPECT_EQ(value_of<double>(m, "fuzz_roughness"), 0.3);
    // α is 0.25 across and 0.25 + 0.75 · 0.36 along the tangent.
    const double ratio = 0.25 / 0.52;
    EXPECT_NEAR(value_of<double>(m, "specular_roughness_anisotropy"), 1 - ratio, 1e-6);
    EXPECT_NEAR(std::pow(value_of<double>(m, "specular_roughness"), 4),
                (0.25 * 0.25 + 0.52 * 0.52) / 2, 1e-6);
    EXPECT_EQ(value_of<Rgb>(find_type(scene, "area"), "radiance"), Rgb(4, 2, 0));
    EXPECT_NEAR(value_of<Rgb>(find_type(scene, "homogeneous"), "sigma_t").r, std::log(2.0) / 2,
                1e-6);
}

TEST(Gltf, TransmissionWithoutVolumeIsAPane) {
    const SceneDescription scene =
        with_material(R"({"extensions":{"KHR_materials_transmission":{"transmissionFactor":1}}})");
    const SceneObject& m = find_type(scene, "openpbr");
    EXPECT_TRUE(value_of<bool>(m, "thin_walled"));
    EXPECT_EQ(value_of<double>(m, "transmission_weight"), 1);
}

TEST(Gltf, TexturesKeepTheirTransformAndSampler) {
    const SceneDescription scene = with_material(
        R"({"alphaMode":"MASK","alphaCutoff":0.25,"pbrMetallicRoughness":{"baseColorTexture":{"index":0,
            "extensions":{"KHR_texture_transform":{"offset":[0.5,0],"rotation":1.5707963267948966,
            "scale":[2,3]}}}}})",
        R"(,"textures":[{"source":0,"sampler":0}],"images":[{"uri":"a.png"}],
            "samplers":[{"magFilter":9728,"wrapS":33071,"wrapT":33071}])");
    const SceneObject& image = find_type(scene, "bitmap");
    EXPECT_EQ(value_of<std::string>(image, "filename"), "a.png");
    EXPECT_EQ(value_of<std::string>(image, "filter_type"), "nearest");
    EXPECT_EQ(value_of<std::string>(image, "wrap_mode"), "clamp");
    const Vec3 uv = value_of<Transform>(image, "to_uv").point({1, 1, 0});
    EXPECT_NEAR(uv.x, 0.5 + 3, 1e-6);  // u' = 0.5 + 3 v
    EXPECT_NEAR(uv.y, -2, 1e-6);
    EXPECT_EQ(value_of<double>(find_type(scene, "threshold"), "cutoff"), 0.25);
}

TEST(Gltf, SpecularReflectionHasAColourAndAWeight) {
    const SceneDescription scene = with_material(
        R"({"pbrMetallicRoughness":{"metallicFactor":0},
            "extensions":{"KHR_materials_ior":{"ior":1000},"KHR_materials_specular":{"specularFactor":0.5,
            "specularTexture":{"index":0},"specularColorFactor":[2,1,0],"specularColorTexture":{"index":1}}}})",
        R"(,"textures":[{"source":0},{"source":1}],"images":[{"uri":"a.png"},{"uri":"b.png"}])");
    expect_no_warning_of_materials(scene);
    const SceneObject& m = find_type(scene, "openpbr");
    EXPECT_EQ(value_of<double>(m, "specular_ior"), 1000);
    ASSERT_EQ(m.children.size(), 2u);
    for (const auto& [name, expected] :
         {std::pair("specular_weight", ParamValue(0.5)), {"specular_color", Rgb(2, 1, 0)}}) {
        const auto c =
            std::find_if(m.children.begin(), m.children.end(),
                         [&, name = name](const auto& child) { return child.name == name; });
        ASSERT_NE(c, m.children.end()) << name;
        const SceneObject& product = scene.objects[size_t(c->object)];
        EXPECT_EQ(product.find("scale")->value, expected);
        const SceneObject& image = scene.objects[size_t(product.children[0].object)];
        const bool is_weight = std::string_view(name) == "specular_weight";
        EXPECT_EQ(image.find("channel") != nullptr, is_weight);  // alpha
        EXPECT_EQ(image.find("raw") != nullptr, is_weight);      // and not sRGB
        EXPECT_EQ(value_of<std::string>(image, "filename"), is_weight ? "a.png" : "b.png");
    }
    // Without textures the factors alone.
    const SceneDescription black = with_material(
        R"({"pbrMetallicRoughness":{"metallicFactor":0.5},
            "extensions":{"KHR_materials_specular":{"specularColorFactor":[0,0,0]}}})");
    EXPECT_EQ(value_of<Rgb>(find_type(black, "openpbr"), "specular_color"), Rgb(0));
    // It is of dielectrics; in openpbr the colour is also that of the edge of metal.
    const SceneDescription metal = with_material(
        R"({"extensions":{"KHR_materials_specular":{"specularFactor":0.5,"specularColorFactor":[0,0,0]}}})");
    EXPECT_FALSE(find_type(metal, "openpbr").find("specular_color"));
    EXPECT_FALSE(find_type(metal, "openpbr").find("specular_weight"));
}

bool warns(const SceneDescription& scene, const std::string& text) {
    return std::any_of(scene.warnings.begin(), scene.warnings.end(),
                       [&](const std::string& w) { return w.find(text) != w.npos; });
}

// By their specification, it has no effect on the direction of refraction.
TEST(Gltf, SpecularReflectionOfGlassLeavesItsIndex) {
    const auto glass = [](const std::string& specular, bool is_solid = true) {
        return with_material(R"({"pbrMetallicRoughness":{"metallicFactor":0},"extensions":{
                "KHR_materials_transmission":{"transmissionFactor":1},)" +
                                 std::string(is_solid ? R"("KHR_materials_volume":
                {"thicknessFactor":1},)"
                                                      : "") +
                                 R"("KHR_materials_specular":{)" + specular + "}}}",
                             R"(,"textures":[{"source":0},{"source":1}],
                "images":[{"uri":"a.png"},{"uri":"b.png"}])");
    };
    const SceneDescription dull = glass(R"("specularFactor":0)");
    EXPECT_FALSE(find_type(dull, "openpbr").find("specular_weight"));
    EXPECT_EQ(value_of<Rgb>(find_type(dull, "openpbr"), "specular_color"), Rgb(0));
    // Colours above 1 are weight.
    const SceneDescription bright = glass(R"("specularFactor":0.5,"specularColorFactor":[1,2,4])");
    EXPECT_EQ(value_of<Rgb>(find_type(bright, "openpbr"), "specular_color"), Rgb(0.5f, 1, 1));
    const SceneDescription textured = glass(
        R"("specularFactor":0.5,"specularTexture":{"index":0},"specularColorTexture":{"index":1})");
    const SceneObject& m = find_type(textured, "openpbr");
    EXPECT_FALSE(m.find("specular_weight"));
    ASSERT_EQ(m.children.size(), 1u);
    const SceneObject& scaled = texture_of(textured, m, "specular_color");
    EXPECT_EQ(value_of<Rgb>(scaled, "scale"), Rgb(0.5f));
    const SceneObject& both = texture_of(textured, scaled, "value");
    EXPECT_EQ(value_of<std::string>(texture_of(textured, both, "value"), "filename"), "b.png");
    const SceneObject& share = texture_of(textured, both, "scale");
    EXPECT_EQ(value_of<std::string>(share, "filename"), "a.png");
    EXPECT_EQ(value_of<std::string>(share, "channel"), "opacity");
    // A pane bends no light.
    const SceneDescription pane = glass(R"("specularFactor":0.25)", false);
    EXPECT_EQ(value_of<double>(find_type(pane, "openpbr"), "specular_weight"), 0.25);
}

TEST(Gltf, NormalsOfClearCoatsAreThoseOfTheMaterial) {
    const auto coated = [](const std::string& normal, const std::string& coat, int factor = 1) {
        return with_material("{" + normal + R"("extensions":{"KHR_materials_clearcoat":{)" + coat +
                                 R"("clearcoatFactor":)" + std::to_string(factor) + "}}}",
                             R"(,"textures":[{"source":0},{"source":1}],
                "images":[{"uri":"a.png"},{"uri":"b.png"}])");
    };
    const char *const kMap = R"("normalTexture":{"index":0,"scale":0.5},)",
                      *const kShared = "the coat has this normal map, too",
                      *const kLost = "clearcoatNormalTexture: has no effect";
    const SceneDescription below = coated(kMap, "");
    EXPECT_TRUE(warns(below, kShared));
    EXPECT_FALSE(warns(below, kLost));
    const SceneDescription same =
        coated(kMap, R"("clearcoatNormalTexture":{"index":0,"scale":0.5},)");
    expect_no_warning_of_materials(same);
    for (const char* other : {R"("clearcoatNormalTexture":{"index":1,"scale":0.5},)",
                              R"("clearcoatNormalTexture":{"index":0},)"}) {
        const SceneDescription scene = coated(kMap, other);
        EXPECT_TRUE(warns(scene, kShared) && warns(scene, kLost)) << other;
    }
    EXPECT_TRUE(warns(coated("", R"("clearcoatNormalTexture":{"index":0},)"), kLost));
    expect_no_warning_of_materials(coated("", ""));
    expect_no_warning_of_materials(coated(kMap, "", 0));
}

// The texels are taken to be 0.5 for the ratio of the roughnesses, which is exact there.
TEST(Gltf, AnisotropyKeepsItsStrengthBesideATextureOfRoughness) {
    const SceneDescription scene = with_material(
        R"({"extensions":{"KHR_materials_anisotropy":{"anisotropyStrength":0.8}},
            "pbrMetallicRoughness":{"metallicRoughnessTexture":{"index":0}}})",
        R"(,"textures":[{"source":0}],"images":[{"uri":"a.png"}])");
    const SceneObject& m = find_type(scene, "openpbr");
    const double across = 0.25, along = 0.25 + 0.75 * 0.64;
    EXPECT_NEAR(value_of<double>(m, "specular_roughness_anisotropy"), 1 - across / along, 1e-6);
    EXPECT_NEAR(std::pow(0.5 * value_of<double>(find_type(scene, "scale"), "scale"), 4),
                (along * along + across * across) / 2, 1e-6);
    EXPECT_TRUE(std::any_of(scene.warnings.begin(), scene.warnings.end(), [](const auto& w) {
        return w.find("beside a texture of the roughness") != w.npos;
    }));
}

TEST(Gltf, TexturesOfSheenAndClearCoatAreRead) {
    const SceneDescription scene = with_material(
        R"({"extensions":{"KHR_materials_sheen":{"sheenColorFactor":[0.5,0.25,0],"sheenColorTexture":{"index":0},
            "sheenRoughnessFactor":0.75,"sheenRoughnessTexture":{"index":1}},
            "KHR_materials_clearcoat":{"clearcoatFactor":1,"clearcoatRoughnessFactor":0.5,
            "clearcoatRoughnessTexture":{"index":2}}}})",
        R"(,"textures":[{"source":0},{"source":1},{"source":2}],
            "images":[{"uri":"a.png"},{"uri":"b.png"},{"uri":"c.png"}])");
    expect_no_warning_of_materials(scene);
    const SceneObject& m = find_type(scene, "openpbr");
    const auto image_of = [&](const SceneObject& product) {
        return scene.objects[size_t(product.children.at(0).object)];
    };
    for (const char* output : {"fuzz_weight", "fuzz_color"}) {
        const SceneObject& part = texture_of(scene, m, output);
        EXPECT_EQ(part.type, "sheen_to_fuzz");
        EXPECT_EQ(value_of<std::string>(part, "output"), output);
        const SceneObject& product = texture_of(scene, part, "color");
        EXPECT_EQ(value_of<Rgb>(product, "scale"), Rgb(0.5f, 0.25f, 0));
        // Colours are sRGB.
        EXPECT_FALSE(image_of(product).find("raw") || image_of(product).find("channel"));
    }
    for (const auto& [name, factor, file, channel] :
         {std::tuple("fuzz_roughness", 0.75, "b.png", "opacity"),
          {"coat_roughness", 0.5, "c.png", "g"}}) {
        const SceneObject& product = texture_of(scene, m, name);
        EXPECT_EQ(value_of<double>(product, "scale"), factor);
        const SceneObject image = image_of(product);
        EXPECT_EQ(value_of<std::string>(image, "filename"), file);
        EXPECT_EQ(value_of<std::string>(image, "channel"), channel);
        EXPECT_TRUE(value_of<bool>(image, "raw"));
    }
    // Textures of black sheen are not read.
    const SceneDescription black =
        with_material(R"({"extensions":{"KHR_materials_sheen":{"sheenColorTexture":{"index":0}}}})",
                      R"(,"textures":[{"source":0}],"images":[{"uri":"a.png"}])");
    EXPECT_EQ(value_of<double>(find_type(black, "openpbr"), "fuzz_weight"), 0);
}

TEST(Gltf, SpecularGlossinessIsReadAsWell) {
    const auto read = [](const char* values) {
        return with_material(std::string(R"({"alphaMode":"BLEND","extensions":
            {"KHR_materials_pbrSpecularGlossiness":{"glossinessFactor":0.7,)") +
                             values + "}}}");
    };
    // A dielectric as others are, half of it there.
    const SceneDescription plastic =
        read(R"("diffuseFactor":[0.5,0.25,1,0.75],"specularFactor":[0.04,0.04,0.04])");
    const SceneObject& p = find_type(plastic, "openpbr");
    const Rgb base = value_of<Rgb>(p, "base_color");
    EXPECT_NEAR(base.r, 0.5f, 1e-5f);
    EXPECT_NEAR(base.g, 0.25f, 1e-5f);
    EXPECT_NEAR(base.b, 1, 1e-5f);
    EXPECT_NEAR(value_of<double>(p, "base_metalness"), 0, 1e-5);
    EXPECT_NEAR(value_of<double>(p, "specular_roughness"), 0.3, 1e-9);
    EXPECT_EQ(value_of<double>(find_type(plastic, "mask"), "opacity"), 0.75);
    // Gold.
    const SceneDescription gold =
        read(R"("diffuseFactor":[0,0,0,1],"specularFactor":[1,0.75,0.3])");
    const SceneObject& g = find_type(gold, "openpbr");
    EXPECT_NEAR(value_of<double>(g, "base_metalness"), 1, 1e-5);
    EXPECT_NEAR(value_of<Rgb>(g, "base_color").g, 0.75f, 1e-4f);
    EXPECT_NEAR(value_of<Rgb>(g, "base_color").b, 0.3f, 1e-4f);
    // Between them: the colours are those of the mixture.
    const SceneDescription half =
        read(R"("diffuseFactor":[0.4,0.4,0.4,1],"specularFactor":[0.3,0.3,0.3])");
    const SceneObject& h = find_type(half, "openpbr");
    const double m = value_of<double>(h, "base_metalness"),
                 b = double(value_of<Rgb>(h, "base_color").r);
    EXPECT_GT(m, 0.1);
    EXPECT_LT(m, 0.9);
    EXPECT_NEAR(0.96 * b * (1 - m), 0.4 * 0.7, 0.02);
    EXPECT_NEAR(0.04 * (1 - m) + b * m, 0.3, 0.02);
}

/// That of a product with this factor.
const SceneObject& scaled_texture(const SceneDescription& scene, const SceneObject& o,
                                  const char* name, Rgb factor) {
    const SceneObject& product = texture_of(scene, o, name);
    EXPECT_EQ(product.type, "scale") << name;
    EXPECT_EQ(value_of<Rgb>(product, "scale"), factor) << name;
    return texture_of(scene, product, "value");
}

TEST(Gltf, SpecularGlossinessHasTextures) {
    const char* const kImages =
        R"(,"textures":[{"source":0},{"source":1}],"images":[{"uri":"a.png"},{"uri":"b.png"}])";
    const auto read = [&](const std::string& values) {
        return with_material(
            R"({"extensions":{"KHR_materials_pbrSpecularGlossiness":{)" + values + "}}}", kImages);
    };
    const SceneDescription both =
        read(R"("diffuseFactor":[0.5,1,1,1],"specularFactor":[1,0.5,0.5],"glossinessFactor":0.8,
                "diffuseTexture":{"index":0},"specularGlossinessTexture":{"index":1})");
    expect_no_warning_of_materials(both);
    const SceneObject& p = find_type(both, "openpbr");
    for (const auto& [name, output] : {std::pair("base_color", "base_color"),
                                       {"base_metalness", "metallic"},
                                       {"specular_weight", "specular_weight"}}) {
        const SceneObject& made = texture_of(both, p, name);
        EXPECT_EQ(made.type, "specular_to_metallic");
        EXPECT_EQ(value_of<std::string>(made, "output"), output);
        const SceneObject &diffuse = scaled_texture(both, made, "diffuse", {0.5f, 1, 1}),
                          &specular = scaled_texture(both, made, "specular", {1, 0.5f, 0.5f});
        EXPECT_EQ(value_of<std::string>(diffuse, "filename"), "a.png");
        EXPECT_EQ(value_of<std::string>(specular, "filename"), "b.png");
        EXPECT_FALSE(specular.find("raw") || specular.find("channel"));  // colours of sRGB
    }
    const SceneObject& rough = texture_of(both, p, "specular_roughness");
    EXPECT_NEAR(value_of<double>(rough, "value1"), 0.2, 1e-9);
    EXPECT_EQ(value_of<std::string>(texture_of(both, rough, "weight"), "channel"), "opacity");

    // The share of metal depends on the diffuse colour where the specular one is brighter than a dielectric's.
    const SceneDescription metal =
        read(R"("specularFactor":[0.5,0.5,0.5],"diffuseTexture":{"index":0})");
    EXPECT_EQ(texture_of(metal, find_type(metal, "openpbr"), "base_metalness").type,
              "specular_to_metallic");
    // Without specular reflection there is none of the dielectric, either.
    const SceneDescription matt = read(
        R"("specularFactor":[0,0,0],"diffuseTexture":{"index":0},"specularGlossinessTexture":{"index":1})");
    const SceneObject& m = find_type(matt, "openpbr");
    EXPECT_EQ(value_of<double>(m, "base_metalness"), 0);
    EXPECT_EQ(value_of<double>(m, "specular_weight"), 0);
    EXPECT_EQ(value_of<std::string>(texture_of(matt, m, "base_color"), "filename"), "a.png");
}

TEST(Gltf, SpecularColoursOfDielectricsAreKept) {
    const SceneDescription gold = with_material(
        R"({"pbrMetallicRoughness":{"baseColorFactor":[0,0,0,1],"metallicFactor":0},
            "extensions":{"KHR_materials_ior":{"ior":0},
            "KHR_materials_specular":{"specularColorFactor":[1,0.75,0.3]}}})");
    expect_no_warning_of_materials(gold);
    const SceneObject& g = find_type(gold, "openpbr");
    EXPECT_EQ(value_of<double>(g, "base_metalness"), 0);
    EXPECT_EQ(value_of<double>(g, "specular_ior"), 1000);  // total reflection
    EXPECT_EQ(value_of<Rgb>(g, "specular_color"), Rgb(1, 0.75f, 0.3f));
}

// What older exporters write, though the format does not allow it.
TEST(Gltf, HabitsOfExportersAreAccepted) {
    Bytes b = square();
    b.add<uint8_t>({51, 0, 255, 255, 51, 0, 255, 255, 51, 0, 255, 255, 51, 0, 255, 255});
    const SceneDescription scene = read(
        document(b, R"("accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":4},
            {"bufferView":1,"componentType":5123,"type":"SCALAR","count":6},
            {"bufferView":2,"componentType":5121,"type":"VEC4","count":4}],
            "bufferViews":[{"buffer":0,"byteLength":48,"byteStride":0},
            {"buffer":0,"byteOffset":48,"byteLength":12},{"buffer":0,"byteOffset":60,"byteLength":16}],
            "nodes":[{"mesh":0},{"extensions":{"KHR_lights_punctual":{"light":0}}}],
            "extensions":{"KHR_lights_punctual":{"lights":[{"type":"spot",
            "spot":{"innerConeAngle":0.7853983,"outerConeAngle":0.7853981}}]}},
            "meshes":[{"primitives":[{"attributes":{"POSITION":0,"COLOR_0":2},"indices":1}]}])"),
        b);
    EXPECT_EQ(scene.meshes[0]->positions[2], (Vec3{1, 1, 0}));
    EXPECT_FLOAT_EQ(scene.meshes[0]->colors[1].x, 0.2f);
    EXPECT_FLOAT_EQ(scene.meshes[0]->colors[1].z, 1);
    EXPECT_TRUE(scene.meshes[0]->alphas.empty());  // one everywhere
    EXPECT_EQ(value_of<double>(find_type(scene, "spot"), "beam_width"),
              value_of<double>(find_type(scene, "spot"), "cutoff_angle"));
}

TEST(Gltf, VertexColoursAreClamped) {
    Bytes b = square();
    b.add<float>({2, -1, 0.5f, 1, 1, 1, 1, 1, 1, 1, 1, 1});
    const SceneDescription scene = read(
        document(b, R"("accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":4},
            {"bufferView":1,"componentType":5123,"type":"SCALAR","count":6},
            {"bufferView":2,"componentType":5126,"type":"VEC3","count":4}],
            "bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":12},
            {"buffer":0,"byteOffset":60,"byteLength":48}],"nodes":[{"mesh":0}],
            "meshes":[{"primitives":[{"attributes":{"POSITION":0,"COLOR_0":2},"indices":1}]}])"),
        b);
    EXPECT_EQ(scene.meshes[0]->colors[0], (Vec3{1, 0, 0.5f}));
}

TEST(Gltf, CamerasLookAlongMinusZ) {
    const SceneDescription scene = read(
        R"({"asset":{"version":"2.0"},"nodes":[{"camera":0,"translation":[0,0,5]},{"camera":1}],"cameras":[
            {"name":"front","type":"perspective","perspective":{"yfov":0.5,"aspectRatio":2}},
            {"type":"orthographic","orthographic":{"xmag":2,"ymag":1,"znear":0,"zfar":9}}]})");
    const SceneObject& camera = find_type(scene, "perspective");
    EXPECT_EQ(camera.id, "front");
    EXPECT_NEAR(value_of<double>(camera, "fov"), 0.5 * 180 / kPi, 1e-5);
    const Transform t = value_of<Transform>(camera, "to_world");
    EXPECT_EQ(t.point({0, 0, 1}), (Vec3{0, 0, 4}));
    EXPECT_EQ(t.vector({1, 0, 0}), (Vec3{-1, 0, 0}));
    EXPECT_GT(t.determinant3(), 0);
    EXPECT_EQ(value_of<int64_t>(scene.objects[size_t(camera.children[0].object)], "width"), 1440);
    EXPECT_EQ(value_of<Transform>(find_type(scene, "orthographic"), "to_world").vector({1, 0, 0}),
              (Vec3{-2, 0, 0}));
}

TEST(Gltf, PunctualLightsShineAlongMinusZ) {
    const SceneDescription scene = read(
        R"({"asset":{"version":"2.0"},"extensions":{"KHR_lights_punctual":{"lights":[
            {"type":"directional","color":[1,0,0],"intensity":3},{"type":"spot","spot":{"outerConeAngle":0.5}},
            {"type":"point"}]}},"nodes":[{"extensions":{"KHR_lights_punctual":{"light":0}}},
            {"extensions":{"KHR_lights_punctual":{"light":1}}},{"translation":[1,2,3],
            "extensions":{"KHR_lights_punctual":{"light":2}}}]})");
    EXPECT_EQ(value_of<Vec3>(find_type(scene, "directional"), "direction"), (Vec3{0, 0, -1}));
    EXPECT_EQ(value_of<Rgb>(find_type(scene, "directional"), "irradiance"), Rgb(3, 0, 0));
    EXPECT_EQ(value_of<Vec3>(find_type(scene, "point"), "position"), (Vec3{1, 2, 3}));
    EXPECT_EQ(value_of<std::string>(find_type(scene, "spot"), "falloff"), "quadratic");
    const Vec3 axis = value_of<Transform>(find_type(scene, "spot"), "to_world").vector({0, 0, 1});
    EXPECT_NEAR(axis.z, -1, 1e-6);
}

TEST(Gltf, ReadsTheContainer) {
    const auto chunk = [](const char* type, std::string contents) {
        const auto length = uint32_t(contents.size());
        return std::string(reinterpret_cast<const char*>(&length), 4) + std::string(type, 4) +
               contents;
    };
    const Bytes b = square();
    const std::string json =
        R"({"asset":{"version":"2.0"},"buffers":[{"byteLength":60}],)" + kSquareAccessors +
        R"(,"nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}]})";
    const std::string body = chunk("JSON", json) + chunk("BIN\0", b.str());
    const uint32_t header[] = {2, uint32_t(12 + body.size())};
    const std::string file = "glTF" + std::string(reinterpret_cast<const char*>(header), 8) + body;
    EXPECT_EQ(read(file).meshes.size(), 1u);
    EXPECT_EQ(error_of(file.substr(0, 100)), "s.gltf: the file ends within a chunk");
}

TEST(Gltf, CompressedMeshesAreReadWhereTheyAreUncompressedAsWell) {
    const auto mesh = [](const char* bytes_of_positions) {
        return document(square(), fmt::format(
                                      R"("extensionsUsed":["KHR_draco_mesh_compression"],
            "accessors":[{{{}"componentType":5126,"type":"VEC3","count":4}},
            {{"bufferView":1,"componentType":5123,"type":"SCALAR","count":6}}],
            "bufferViews":[{{"buffer":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":12}}],
            "nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1,
            "extensions":{{"KHR_draco_mesh_compression":{{"bufferView":0,"attributes":{{"POSITION":0}}}}}}}}]}}])",
                                      bytes_of_positions));
    };
    EXPECT_EQ(error_of(mesh("\"bufferView\":0,"), square()), "");
    EXPECT_EQ(error_of(mesh(""), square()),
              "s.gltf: /meshes/0/primitives/0: KHR_draco_mesh_compression is not supported");
}

TEST(Gltf, ErrorsNameThePlace) {
    const Bytes b = square();
    const std::pair<std::string, const char*> cases[] = {
        {R"({"asset":{"version":"1.0"}})",
         "s.gltf: /asset/version: is \"1.0\", but only glTF 2 is supported"},
        {"{\n\"asset\":}", "s.gltf:2: malformed JSON"},
        {"{\"asset\": 1e999}", "s.gltf:1: malformed JSON: the number 1e999 is too large"},
        {R"({"asset":{"version":"2.0"},"nodes":[{"mesh":0}]})",
         "s.gltf: /nodes/0/mesh: refers to an entry of an empty list"},
        {R"({"asset":{"version":"2.0"},"scenes":[{"nodes":[0]}],"nodes":[{"children":[0]}]})",
         "s.gltf: /nodes/0: the node occurs twice in the scene"},
        {R"({"asset":{"version":"2.0"},"extensionsRequired":["KHR_draco_mesh_compression"]})",
         "s.gltf: /extensionsRequired/0: the extension KHR_draco_mesh_compression is not "
         "supported"},
        {R"({"asset":{"version":"2.0"},"nodes":[{"translation":[1,2]}]})",
         "s.gltf: /nodes/0/translation: must have 3 numbers, but has 2"},
        {document(b, R"("accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":6}],
            "bufferViews":[{"buffer":0,"byteLength":60}],"nodes":[{"mesh":0}],"meshes":[{"primitives":
            [{"attributes":{"POSITION":0}}]}])"),
         "s.gltf: /accessors/0: needs more than the 60 bytes of its bufferView"},
        {document(b, R"("accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":2},
            {"bufferView":1,"componentType":5123,"type":"SCALAR","count":6}],
            "bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":12}],
            "nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}])"),
         "s.gltf: /meshes/0/primitives/0/indices: has the index 2 of 2 vertices"},
    };
    for (const auto& [json, expected] : cases)
        EXPECT_EQ(error_of(json, b).rfind(expected, 0), 0u)
            << error_of(json, b) << "\nexpected " << expected;
}

}  // namespace
}  // namespace etendue
