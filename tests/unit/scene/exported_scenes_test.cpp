// Scenes as exporters and converters write them: what the camera sees, in numbers. All materials emit or are black, so
// that one ray gives the radiance of a film point.

#include <array>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "error_of.h"
#include "gltf_document.h"
#include "image/image_io.h"
#include "readers/gltf.h"
#include "readers/ply.h"
#include "readers/scene_file.h"
#include "run_program.h"
#include "test_scenes.h"

namespace etendue::test {
namespace {

using Json = GltfDocument::Json;

constexpr Rgb kRed{1, 0, 0}, kGreen{0, 1, 0}, kBlue{0, 0, 1}, kWhite{1, 1, 1}, kBlack{0, 0, 0};

/// Radiance along the ray of a film point, given in fractions of the film; the mean over the decisions of masks.
Rgb seen(const Scene& scene, float x, float y) {
    const FilmGeometry& film = scene.film();
    const SensorRay eye =
        scene.sensor().sample_ray({x * float(film.width), y * float(film.height)}, {0.5f, 0.5f});
    constexpr int kMasks = 20;
    Rgb sum;
    for (int i = 0; i < kMasks; ++i) {
        SurfaceHit hit;
        const float u = (float(i) + 0.5f) / kMasks;
        if (scene.intersect({eye.p, eye.d, kInf}, u, hit)) {
            if (const Emitter* e = hit.shape->emitter)
                sum += e->eval_surface(hit.geometry.ng, {hit.location.u, hit.location.v},
                                       hit.location.prim, -eye.d)
                           .Le;
        } else {
            for (const Emitter* e : scene.infinite_emitters()) sum += e->eval_infinite(eye.d).Le;
        }
    }
    return sum * (1.0f / kMasks);
}

void expect_colour(const Rgb& found, const Rgb& expected, const std::string& where) {
    for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(found[c], expected[c], 1e-4) << where << ", channel " << c;
}

/// The centres of the four quarters of the film: above on the left and on the right, below.
void expect_quarters(const Scene& scene, const std::array<Rgb, 4>& expected) {
    for (int i = 0; i < 4; ++i)
        expect_colour(seen(scene, i % 2 ? 0.75f : 0.25f, i / 2 ? 0.75f : 0.25f),
                      expected[size_t(i)], fmt::format("quarter {}", i));
}

/// An image of two by two pixels: red and green above, blue and white below.
std::string four_colours() {
    const uint8_t codes[] = {255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255};
    return encode_png(2, 2, codes);
}
constexpr std::array<Rgb, 4> kFour = {kRed, kGreen, kBlue, kWhite};

class ExportedScenes : public ::testing::Test {
protected:
    std::string path(const std::string& name) const { return (folder_.path() / name).string(); }
    void write(const std::string& name, std::string_view bytes) const {
        write_file(folder_.path() / name, bytes);
    }
    Scene gltf(const GltfDocument& document) const {
        write("mesh.bin", document.bytes());
        write("scene.gltf", document.text("mesh.bin"));
        return build_scene(read_scene_file(path("scene.gltf")));
    }
    Scene xml(const std::string& body, const std::string& version = "3.0.0") const {
        write("scene.xml", fmt::format("<scene version=\"{}\">{}</scene>", version, body));
        return build_scene(read_scene_file(path("scene.xml")));
    }
    /// A square that emits what an image says, and the image.
    GltfDocument picture(const std::string& uri, const Json& sampler = nullptr,
                         const std::vector<float>& uvs = {0, 1, 1, 1, 1, 0, 0, 0}) const {
        GltfDocument d;
        d.add("images", {{"uri", uri}});
        Json texture = {{"source", 0}};
        if (!sampler.is_null()) texture["sampler"] = d.add("samplers", sampler);
        d.add("textures", texture);
        Json material = GltfDocument::glow({1, 1, 1});
        material["emissiveTexture"] = {{"index", 0}};
        d.node({{"mesh", d.square(d.add("materials", material), uvs)}});
        return d;
    }

    TemporaryFolder folder_;
};

const char* const kNearest = "<string name=\"filter_type\" value=\"nearest\"/>";

std::string flat_camera(const char* film = "") {
    return fmt::format(R"(<sensor type="orthographic"><transform name="to_world">
        <lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform><film type="hdrfilm">
        <integer name="width" value="8"/><integer name="height" value="8"/>{}</film></sensor>)",
                       film);
}

// ---- PLY: texture coordinates and colours of faces

std::string ply(const std::string& format, const std::string& faces, const std::string& body) {
    return "ply\nformat " + format + " 1.0\ncomment TextureFile four.png\nelement vertex 4\n" +
           "property float x\nproperty float y\nproperty float z\n" + faces + "end_header\n" + body;
}
const char* const kCorners = "-1 -1 0\n1 -1 0\n1 1 0\n-1 1 0\n";

/// The square of a PLY file that emits an image.
Scene ply_picture(const std::string& file, const std::string& folder) {
    return build_scene(
        parse_mitsuba_xml("<scene version=\"3.0.0\">" + flat_camera() +
                              fmt::format(R"(<shape type="ply"><string name="filename" value="{}"/>
                <emitter type="area"><texture type="bitmap" name="radiance">
                <string name="filename" value="{}/four.png"/>{}</texture></emitter></shape>)",
                                          file, folder, kNearest) +
                              "</scene>",
                          "scene.xml"));
}

// The two triangles of a square show one texel each, at corners that both share.
TEST_F(ExportedScenes, PlyCornersHaveTextureCoordinatesOfTheirOwn) {
    write("four.png", four_colours());
    write("square.ply", ply("ascii",
                            "element face 2\nproperty list uchar int vertex_indices\n"
                            "property list uchar float texcoord\nproperty int texnumber\n",
                            std::string(kCorners) + "3 0 1 2 6 .1 .1 .2 .1 .2 .2 0\n"
                                                    "3 0 2 3 6 .8 .1 .9 .1 .9 .2 0\n"));
    const Scene scene = ply_picture(path("square.ply"), folder_.path());
    expect_colour(seen(scene, 0.75f, 0.75f), kRed, "first triangle");
    expect_colour(seen(scene, 0.25f, 0.25f), kGreen, "second triangle");
}

TEST_F(ExportedScenes, PlyQuadsHaveTextureCoordinatesOfTheirCorners) {
    write("four.png", four_colours());
    write("square.ply", ply("ascii",
                            "element face 1\nproperty list uchar float texcoord\n"
                            "property list uchar int vertex_index\n",
                            std::string(kCorners) + "8 0 1 1 1 1 0 0 0 4 0 1 2 3\n"));
    expect_quarters(ply_picture(path("square.ply"), folder_.path()), kFour);
}

TEST(ExportedMeshes, PlySplitsOnlyWhereCornersDiffer) {
    const MeshData m =
        parse_ply(ply("ascii",
                      "element face 3\nproperty list uchar int vertex_indices\n"
                      "property list uchar float texcoord\n",
                      std::string(kCorners) + "3 0 1 2 6 0 0 1 0 1 1\n3 0 2 3 6 0 0 1 1 .5 1\n"
                                              "3 0 1 3 0\n"),
                  "s.ply");
    // Both textured triangles share two corners; the third has (0, 0), which vertex 0 has already.
    EXPECT_EQ(m.positions.size(), 6u);
    EXPECT_EQ(m.triangles[1], (MeshData::Triangle{0, 2, 3}));
    EXPECT_EQ(m.triangles[2], (MeshData::Triangle{0, 4, 5}));
    EXPECT_EQ(m.positions[5], m.positions[3]);
    EXPECT_EQ(m.uvs[5], (Vec2{0, 0}));
    EXPECT_TRUE(m.notes.empty());
}

TEST(ExportedMeshes, PlyFacesHaveColours) {
    const MeshData m =
        parse_ply(ply("ascii",
                      "element face 2\nproperty list uchar int vertex_indices\nproperty uchar "
                      "red\nproperty uchar green\nproperty uchar blue\n",
                      std::string(kCorners) + "3 0 1 2 255 0 0\n3 0 2 3 0 51 255\n"),
                  "s.ply");
    ASSERT_EQ(m.colors.size(), 6u);
    for (int corner = 0; corner < 3; ++corner) {
        EXPECT_EQ(m.colors[m.triangles[0][size_t(corner)]], (Vec3{1, 0, 0}));
        const Vec3 second = m.colors[m.triangles[1][size_t(corner)]];
        EXPECT_EQ(second.x, 0);
        EXPECT_FLOAT_EQ(second.y, 0.2f);
        EXPECT_EQ(second.z, 1);
    }
}

TEST(ExportedMeshes, PlyStripsAreTriangles) {
    const MeshData m =
        parse_ply(ply("ascii", "element tristrips 1\nproperty list int int vertex_indices\n",
                      std::string(kCorners) + "8 0 1 3 2 -1 0 1 2\n"),
                  "s.ply");
    EXPECT_EQ(m.triangles, (std::vector<MeshData::Triangle>{{0, 1, 3}, {3, 1, 2}, {0, 1, 2}}));
}

TEST(ExportedMeshes, PlySaysWhatIsNotUsed) {
    const MeshData m = parse_ply(
        ply("ascii",
            "element face 2\nproperty list uchar int vertex_indices\nproperty int texnumber\n"
            "property float quality\nproperty float shininess\n",
            std::string(kCorners) + "3 0 1 2 0 1 1\n3 0 2 3 1 1 1\n"),
        "s.ply");
    ASSERT_EQ(m.notes.size(), 2u);
    EXPECT_NE(m.notes[0].find("several textures (texnumber)"), std::string::npos);
    EXPECT_EQ(m.notes[1], "not used: shininess of face");
}

TEST(ExportedMeshes, PlyRejectsCoordinatesThatDoNotFit) {
    const std::string text = ply("ascii",
                                 "element face 1\nproperty list uchar int vertex_indices\n"
                                 "property list uchar float texcoord\n",
                                 std::string(kCorners) + "3 0 1 2 4 0 0 1 1\n");
    EXPECT_EQ(error_of([&] { parse_ply(text, "s.ply"); }),
              "s.ply:16: a face of 3 corners has 4 texture coordinates, but needs 6");
}

// ---- glTF: names of files

TEST_F(ExportedScenes, GltfNamesAreDecoded) {
    write("a folder/four #1 \xc3\xbc.png", four_colours());
    GltfDocument d = picture("a%20folder/four%20%231%20%C3%BC.png");
    d.camera();
    write("a folder/the mesh%.bin", d.bytes());
    write("s.gltf", d.text("a%20folder/the%20mesh%25.bin"));
    expect_quarters(build_scene(read_scene_file(path("s.gltf"))), kFour);
}

TEST_F(ExportedScenes, FoldersOfWindowsAreFound) {
    write("maps/four.png", four_colours());
    GltfDocument d = picture("maps\\four.png");
    d.camera();
    expect_quarters(gltf(d), kFour);
    write("part.xml", "<scene version=\"3.0.0\">" + flat_camera() + "</scene>");
    write("scenes/lamp.xml", R"(<scene version="3.0.0"><shape type="rectangle"><emitter type="area">
        <texture type="bitmap" name="radiance"><string name="filename" value="maps\four.png"/>
        <string name="filter_type" value="nearest"/></texture></emitter></shape></scene>)");
    const Scene scene =
        xml("<include filename=\"part.xml\"/><include filename=\"scenes\\lamp.xml\"/>");
    expect_quarters(scene, {kBlue, kWhite, kRed, kGreen});  // v runs upward on a rectangle
}

TEST_F(ExportedScenes, MissingFilesNameWhatIsNear) {
    write("maps/Wood.PNG", four_colours());
    const auto error = [&](const std::string& file) {
        return error_of([&] {
            xml(flat_camera() +
                fmt::format("<shape type=\"rectangle\"><bsdf type=\"diffuse\"><texture "
                            "type=\"bitmap\" name=\"reflectance\"><string name=\"filename\" "
                            "value=\"{}\"/></texture></bsdf></shape>",
                            file));
        });
    };
    for (const char* file :
         {"Maps/wood.png", "maps/Wod.PNG", "wood.png", "Maps\\wood.png",
          "C:\\Users\\me\\scene\\wood.png", "\\\\server\\share\\wood.png", "/home/me/wood.png"}) {
        const std::string message = error(file);
        EXPECT_NE(message.find("did you mean \"maps/Wood.PNG\"?"), std::string::npos) << message;
    }
}

TEST_F(ExportedScenes, GltfDataNeedNoFiles) {
    GltfDocument d;
    d.node({{"mesh", d.square(d.add("materials", GltfDocument::glow({0, 1, 0})))}});
    d.camera();
    std::string uri = "data:application/octet-stream,";
    for (const char c : d.bytes()) uri += fmt::format("%{:02X}", static_cast<unsigned char>(c));
    const Scene scene = build_scene(parse_gltf(d.text(uri), "s.gltf"));
    expect_colour(seen(scene, 0.5f, 0.5f), kGreen, "centre");
    // "=" may be written as %3D, and the "+" and "/" of base64 too.
    const std::string bad = error_of([&] {
        parse_gltf(R"({"asset":{"version":"2.0"},"nodes":[{"mesh":0}],"meshes":[{"primitives":
            [{"attributes":{"POSITION":0}}]}],"accessors":[{"bufferView":0,"componentType":5126,
            "type":"VEC3","count":1}],"bufferViews":[{"buffer":0,"byteLength":2}],
            "buffers":[{"byteLength":2,"uri":"data:;base64,%2B%2F8%3D"}]})",
                   "s.gltf");
    });
    EXPECT_EQ(bad, "s.gltf: /accessors/0: needs more than the 2 bytes of its bufferView");
}

// ---- glTF: opacity of vertices

/// A black square before a green one, with these colours of its corners.
GltfDocument veil(const Json& material, size_t components, int type, auto colours,
                  bool normalized) {
    GltfDocument d;
    d.node({{"mesh", d.square(d.add("materials", GltfDocument::glow({0, 1, 0})))},
            {"translation", {0, 0, -1}}});
    Json black = {
        {"pbrMetallicRoughness", {{"baseColorFactor", {0, 0, 0, 1}}, {"metallicFactor", 0}}}};
    black.update(material);
    const size_t colour =
        d.accessor(components == 4 ? "VEC4" : "VEC3", components, type, colours, normalized);
    d.node({{"mesh", d.square(d.add("materials", black), {0, 1, 1, 1, 1, 0, 0, 0},
                              {{"COLOR_0", colour}})}});
    d.camera();
    return d;
}

TEST_F(ExportedScenes, GltfAlphaOfVerticesIsOpacity) {
    const auto all = [](auto r, auto a) {
        std::vector<decltype(r)> colours;
        for (int i = 0; i < 4; ++i) colours.insert(colours.end(), {r, r, r, a});
        return colours;
    };
    const auto at_centre = [&](const GltfDocument& d) { return seen(gltf(d), 0.4f, 0.5f); };
    const Json mask = {{"alphaMode", "MASK"}}, blend = {{"alphaMode", "BLEND"}};
    const auto floats = all(1.0f, 0.25f);
    const auto bytes = all(uint8_t(255), uint8_t(51));
    const auto shorts = all(uint16_t(65535), uint16_t(13107));
    expect_colour(at_centre(veil(blend, 4, GltfDocument::kFloat, floats, false)), Rgb(0, 0.75f, 0),
                  "blend");
    expect_colour(at_centre(veil(blend, 4, GltfDocument::kByte, bytes, true)), Rgb(0, 0.8f, 0),
                  "bytes");
    expect_colour(at_centre(veil(blend, 4, GltfDocument::kShort, shorts, true)), Rgb(0, 0.8f, 0),
                  "shorts");
    expect_colour(at_centre(veil(mask, 4, GltfDocument::kFloat, floats, false)), kGreen, "mask");
    expect_colour(at_centre(veil(Json::object(), 4, GltfDocument::kFloat, floats, false)), kBlack,
                  "opaque");
    // The material's own alpha is a factor, and colours without alpha are opaque.
    Json half = blend;
    half["pbrMetallicRoughness"] = {{"baseColorFactor", {0, 0, 0, 0.5}}, {"metallicFactor", 0}};
    expect_colour(at_centre(veil(half, 4, GltfDocument::kByte, bytes, true)), Rgb(0, 0.9f, 0),
                  "both");
    expect_colour(at_centre(veil(half, 3, GltfDocument::kFloat, std::vector<float>(12, 1), false)),
                  Rgb(0, 0.5f, 0), "three components");
}

// Alpha is interpolated, and a cutoff applies to what is interpolated.
TEST_F(ExportedScenes, GltfAlphaOfVerticesIsInterpolated) {
    const std::vector<float> colours = {1, 1, 1, 0, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 0};
    const auto at = [&](const Json& mode, float x) {
        return seen(gltf(veil(mode, 4, GltfDocument::kFloat, colours, false)), x, 0.4f).g;
    };
    EXPECT_NEAR(at({{"alphaMode", "BLEND"}}, 0.2f), 0.8, 1e-3);
    EXPECT_NEAR(at({{"alphaMode", "BLEND"}}, 0.9f), 0.1, 1e-3);
    const Json mask = {{"alphaMode", "MASK"}, {"alphaCutoff", 0.3}};
    EXPECT_EQ(at(mask, 0.29f), 1);
    EXPECT_EQ(at(mask, 0.31f), 0);
}

// ---- Wrapping

TEST_F(ExportedScenes, TexturesWrapByAxis) {
    write("four.png", four_colours());
    constexpr int kRepeat = 10497, kClamp = 33071, kMirror = 33648;
    struct Case {
        int s, t;
        std::array<const char*, 4> rows;
    };
    const Case cases[] = {{kRepeat, kClamp, {"RGRG", "BWBW", "BWBW", "BWBW"}},
                          {kClamp, kMirror, {"RGGG", "BWWW", "BWWW", "RGGG"}},
                          {kMirror, kRepeat, {"RGGR", "BWWB", "RGGR", "BWWB"}},
                          {kClamp, kClamp, {"RGGG", "BWWW", "BWWW", "BWWW"}}};
    for (const Case& c : cases) {
        GltfDocument d = picture("four.png", {{"magFilter", 9728}, {"wrapS", c.s}, {"wrapT", c.t}},
                                 {0, 2, 2, 2, 2, 0, 0, 0});
        d.camera();
        const Scene scene = gltf(d);
        EXPECT_TRUE(scene.warnings().empty());
        for (int i = 0; i < 16; ++i) {
            const char key = c.rows[size_t(i / 4)][i % 4];
            const Rgb expected = key == 'R'   ? kRed
                                 : key == 'G' ? kGreen
                                 : key == 'B' ? kBlue
                                              : kWhite;
            expect_colour(seen(scene, 0.125f + 0.25f * float(i % 4), 0.125f + 0.25f * float(i / 4)),
                          expected, fmt::format("{} {}, field {}", c.s, c.t, i));
        }
    }
}

// A texture without end in one direction, and black or white outside of it in the other.
TEST_F(ExportedScenes, TexturesMayEnd) {
    write("four.png", four_colours());
    const auto scene = [&](const char* version, const char* modes) {
        return xml(flat_camera() + fmt::format(R"(<shape type="rectangle"><emitter type="area">
            <texture type="bitmap" name="radiance"><string name="filename" value="four.png"/>{}{}
            <transform name="to_uv"><scale x="2" y="-2"/></transform></texture></emitter></shape>)",
                                               kNearest, modes),
                   version);
    };
    const Scene zero = scene("3.0.0", R"(<string name="wrap_mode" value="zero"/>
        <string name="wrap_mode_v" value="repeat"/>)");
    for (const float y : {0.1f, 0.6f}) {
        expect_colour(seen(zero, 0.1f, y), kRed, "inside");
        expect_colour(seen(zero, 0.4f, y), kGreen, "inside");
        expect_colour(seen(zero, 0.6f, y), kBlack, "outside");
    }
    // In Mitsuba 0.6 each direction may have its own mode.
    const auto modes = [](const std::string& params) {
        const SceneDescription old =
            parse_mitsuba_xml("<scene version=\"0.6.0\"><texture type=\"bitmap\" id=\"t\">" +
                                  params + "</texture></scene>",
                              "s.xml");
        std::string found;
        for (const char* name : {"wrap_mode", "wrap_mode_v"}) {
            const Param* p = old.objects[0].find(name);
            found += (p ? *p->as<std::string>() : "-") + " ";
        }
        return found;
    };
    const std::string u = R"(<string name="wrapModeU" value="clamp"/>)",
                      v = R"(<string name="wrapModeV" value="one"/>)",
                      both = R"(<string name="wrapMode" value="clamp"/>)";
    EXPECT_EQ(modes(v), "- one ");
    EXPECT_EQ(modes(u), "clamp repeat ");
    EXPECT_EQ(modes(u + v), "clamp one ");
    EXPECT_EQ(modes(both), "clamp - ");
    EXPECT_EQ(modes(both + v), "clamp one ");
    EXPECT_EQ(modes(both + R"(<string name="wrapModeV" value="repeat"/>)"), "clamp repeat ");
}

// ---- Cameras

TEST_F(ExportedScenes, GltfCamerasIgnoreTheScaleOfTheirNodes) {
    write("four.png", four_colours());
    const Json kinds[] = {
        {{"type", "orthographic"},
         {"orthographic", {{"xmag", 1}, {"ymag", 1}, {"znear", 0}, {"zfar", 9}}}},
        {{"type", "perspective"},
         {"perspective", {{"yfov", 2 * std::atan(0.2)}, {"aspectRatio", 1}, {"znear", 0.01}}}}};
    for (const Json& kind : kinds)
        for (const std::array<float, 3> scale :
             {std::array<float, 3>{1, 1, 1}, {0.01f, 0.01f, 0.01f}, {1, 2, 0.5f}, {-1, 3, 2}}) {
            GltfDocument d = picture("four.png");
            d.add("cameras", kind);
            d.node({{"camera", 0}, {"translation", {0, 0, 5 / scale[2]}}});
            const size_t inner = d.json["nodes"].size() - 1;
            const size_t outer = d.node({{"scale", scale}, {"children", Json::array({inner})}});
            d.set_roots({0, outer});
            SCOPED_TRACE(kind["type"].get<std::string>() + fmt::format(" {}", scale[0]));
            expect_quarters(gltf(d), kFour);
        }
}

// Scale above a rotation shears; the view still goes along the -z of the node, with its y above.
TEST_F(ExportedScenes, GltfCamerasKeepTheirDirectionUnderShear) {
    GltfDocument d;
    d.node({{"mesh", d.square(d.add("materials", GltfDocument::glow({1, 0, 0})))},
            {"translation", {-6, 0, -1}},
            {"rotation", {0, std::sqrt(0.5), 0, std::sqrt(0.5)}}});
    d.add("cameras", {{"type", "orthographic"},
                      {"orthographic", {{"xmag", 0.5}, {"ymag", 0.5}, {"znear", 0}, {"zfar", 9}}}});
    // Turned by 45° about y, under a scale of 1 : 1 : 1/6: along -z is (-1, 0, -1/6) in the world.
    const double half = kPi / 8;
    d.node({{"camera", 0}, {"rotation", {0, std::sin(half), 0, std::cos(half)}}});
    const size_t outer = d.node({{"scale", {1, 1, 1.0 / 6}}, {"children", Json::array({1})}});
    d.set_roots({0, outer});
    const Scene scene = gltf(d);
    for (const float x : {0.1f, 0.9f})
        for (const float y : {0.1f, 0.9f}) expect_colour(seen(scene, x, y), kRed, "square");
}

TEST_F(ExportedScenes, GltfFilmsHaveTheShapeOfTheView) {
    write("four.png", four_colours());
    GltfDocument d = picture("four.png", {{"magFilter", 9728}});
    d.add("cameras", {{"type", "orthographic"},
                      {"orthographic", {{"xmag", 1}, {"ymag", 0.5}, {"znear", 0}, {"zfar", 9}}}});
    d.node({{"camera", 0}, {"translation", {0, 0, 5}}});
    const Scene scene = gltf(d);
    EXPECT_EQ(scene.film().width, 2 * scene.film().height);
    // Seen are x from -1 to 1 and y from -0.5 to 0.5.
    expect_colour(seen(scene, 0.02f, 0.02f), kRed, "above on the left");
    expect_colour(seen(scene, 0.98f, 0.98f), kWhite, "below on the right");
}

// ---- pbrt: directives that go on behind an included file

const char* const kLamp = "LookAt 0 0 5  0 0 0  0 1 0\nCamera \"orthographic\"\nFilm \"rgb\" "
                          "\"integer xresolution\" 8 \"integer yresolution\" 8\nWorldBegin\n";

TEST_F(ExportedScenes, PbrtDirectivesGoOnBehindAnInclude) {
    write("lights/begin.pbrt", "# A light without its value\nAreaLightSource \"diffuse\"\n");
    write("shape.pbrt", "Shape");
    write("value.pbrt", "\"rgb L\" [ .2 .4");
    write("scene.pbrt", std::string(kLamp) +
                            "Include \"lights/begin.pbrt\"\nInclude \"value.pbrt\" .6 ]\n"
                            "Include \"shape.pbrt\" \"sphere\" \"float radius\" 1\n");
    // The next directive of the outer file ends the one of the included file.
    EXPECT_EQ(error_of([&] { read_scene_file(path("scene.pbrt")); }),
              path("value.pbrt") + ":1: expected a directive, found the string \"rgb L\"");
    write("scene.pbrt", std::string(kLamp) +
                            "Include \"lights/begin.pbrt\" \"rgb L\" [ .2 .4 .6 ]\n"
                            "Include \"shape.pbrt\" \"sphere\" \"float radius\" 1\n");
    const Scene scene = build_scene(read_scene_file(path("scene.pbrt")));
    expect_colour(seen(scene, 0.5f, 0.5f), Rgb(0.2f, 0.4f, 0.6f), "ball");
}

TEST_F(ExportedScenes, PbrtErrorsNameTheFileOfTheToken) {
    write("begin.pbrt", "AreaLightSource \"diffuse\"\n\"rgb L\"\n");
    write("scene.pbrt", std::string(kLamp) + "Include \"begin.pbrt\"\n[ .2 x ]\n");
    const std::string message = error_of([&] { read_scene_file(path("scene.pbrt")); });
    EXPECT_EQ(message.rfind(path("scene.pbrt") + ":6: ", 0), 0u) << message;
    // A file that was left may be included again, one that is open may not.
    write("twice.pbrt", "Shape \"sphere\"\n");
    write("scene.pbrt", std::string(kLamp) + "Include \"twice.pbrt\"\n\"float radius\" 1\nInclude "
                                             "\"twice.pbrt\"\nAreaLightSource \"diffuse\"\nInclude "
                                             "\"twice.pbrt\"\n");
    EXPECT_EQ(build_scene(read_scene_file(path("scene.pbrt"))).shapes().size(), 3u);
    write("twice.pbrt", "Include \"twice.pbrt\"\n");
    EXPECT_NE(error_of([&] { read_scene_file(path("scene.pbrt")); }).find("includes itself"),
              std::string::npos);
}

// What is imported is complete: its last directive ends with the file.
TEST_F(ExportedScenes, PbrtImportsAreComplete) {
    write("begin.pbrt", "Shape \"sphere\"\n");
    write("scene.pbrt", std::string(kLamp) + "AreaLightSource \"diffuse\"\nImport "
                                             "\"begin.pbrt\"\n\"float radius\" 1\n");
    EXPECT_EQ(error_of([&] { read_scene_file(path("scene.pbrt")); }),
              path("scene.pbrt") + ":7: expected a directive, found the string \"float radius\"");
}

// ---- Mitsuba

TEST_F(ExportedScenes, SpectraMayBeTextures) {
    write("four.png", four_colours());
    const Scene scene =
        xml(flat_camera() + fmt::format(R"(<shape type="rectangle"><emitter type="area">
            <spectrum type="bitmap" name="radiance"><string name="filename" value="four.png"/>{}
            <transform name="to_uv"><scale y="-1"/></transform></spectrum></emitter></shape>)",
                                        kNearest));
    expect_quarters(scene, kFour);
}

TEST_F(ExportedScenes, CamerasWithoutLensHaveAFocus) {
    for (const char* type : {"perspective", "orthographic"})
        for (const auto& [name, version] :
             {std::pair("focusDistance", "0.6.0"), {"focus_distance", "3.0.0"}}) {
            const Scene scene =
                xml(fmt::format("<sensor type=\"{}\"><float name=\"{}\" value=\"3\"/></sensor>"
                                "<shape type=\"sphere\"><emitter type=\"area\"/></shape>",
                                type, name),
                    version);
            EXPECT_TRUE(scene.warnings().empty());
        }
}

TEST_F(ExportedScenes, EntitiesAreReplaced) {
    write("scene.xml",
          R"(<?xml version="1.0"?>
<!-- <!ENTITY grey "no"> -->
<!DOCTYPE scene [
    <!ENTITY grey "0.25">
    <!ENTITY lamp '<emitter type="area"><rgb
        name="radiance" value="&grey; 0.5 1"/></emitter>'>
    <!ENTITY grey "1">
]>
<scene version="3.0.0">)" +
              flat_camera() +
              R"(<!-- &nothing; &lamp; --><shape type="rectangle">&lamp;</shape></scene>)");
    const Scene scene = build_scene(read_scene_file(path("scene.xml")));
    expect_colour(seen(scene, 0.5f, 0.5f), Rgb(0.25f, 0.5f, 1), "centre");
}

TEST(ExportedXml, EntitiesHaveLimits) {
    const auto error = [](const std::string& declared, const std::string& body) {
        return error_of([&] {
            parse_mitsuba_xml("<!DOCTYPE scene [" + declared + "]>\n<scene version=\"3.0.0\">\n" +
                                  body + "</scene>",
                              "s.xml");
        });
    };
    EXPECT_EQ(
        error(R"(<!ENTITY camera SYSTEM "camera.inc">)", "\n&camera;")
            .rfind("s.xml:4: the entity \"camera\" stands for the file \"camera.inc\": entities in "
                   "other files are not read",
                   0),
        0u);
    EXPECT_EQ(error(R"(<!ENTITY c PUBLIC "-//x//" "http://x/c.ent">)", "&c;")
                  .rfind("s.xml:3: the entity \"c\" stands for the file \"http://x/c.ent\"", 0),
              0u);
    EXPECT_EQ(error(R"(<!ENTITY a "&b;"><!ENTITY b "&a;">)", "&a;").rfind("s.xml:3: the entity", 0),
              0u);
    // A billion laughs, and as many silences.
    for (const char* word : {"laugh", ""}) {
        std::string declared = fmt::format("<!ENTITY e0 \"{}\">", word);
        for (int i = 1; i < 12; ++i) {
            declared += fmt::format("<!ENTITY e{} \"", i);
            for (int k = 0; k < 10; ++k) declared += fmt::format("&e{};", i - 1);
            declared += "\">";
        }
        EXPECT_EQ(error(declared, "&e11;")
                      .rfind("s.xml:3: the entities of the file stand for more "
                             "than 16777216 characters",
                             0),
                  0u);
    }
    // Lines after an entity of several lines keep their numbers.
    EXPECT_EQ(
        error("<!ENTITY two \"\n\n\">", "&two;\n<thing/>").rfind("s.xml:6: unknown element", 0),
        0u);
}

// ---- Emission behind masks

TEST_F(ExportedScenes, GltfMasksHideEmission) {
    const auto lamp = [&](double alpha, const char* mode) {
        GltfDocument d;
        Json glow = GltfDocument::glow({1, 1, 1});
        glow["pbrMetallicRoughness"]["baseColorFactor"] = {0, 0, 0, alpha};
        glow["alphaMode"] = mode;
        d.node({{"mesh", d.square(d.add("materials", glow))}});
        d.node({{"mesh", d.square(d.add("materials", GltfDocument::glow({0, 1, 0})))},
                {"translation", {0, 0, -1}}});
        d.camera();
        return seen(gltf(d), 0.4f, 0.5f);
    };
    expect_colour(lamp(0.2, "MASK"), kGreen, "below the cutoff");
    expect_colour(lamp(0.7, "MASK"), kWhite, "above the cutoff");
    expect_colour(lamp(0.2, "OPAQUE"), kWhite, "opaque");
    expect_colour(lamp(0.4, "BLEND"), Rgb(0.4f, 1, 0.4f), "blend");
}

// Light paths and next events see the emission times the opacity.
TEST_F(ExportedScenes, MasksHideEmissionFromAllSides) {
    const Scene scene = xml(flat_camera() + R"(<shape type="rectangle"><bsdf type="mask">
        <texture type="checkerboard" name="opacity"><float name="color0" value="0.25"/>
        <float name="color1" value="0"/></texture><bsdf type="diffuse"/></bsdf>
        <emitter type="area"><rgb name="radiance" value="4"/></emitter></shape>)");
    const Emitter& lamp = scene.emitter(0);
    int dark = 0;
    for (int i = 0; i < 64; ++i) {
        const double a = (i % 8 + 0.5) / 8, b = (i / 8 + 0.5) / 8;
        const EmissionSample e = lamp.sample_emission({a, b}, {0.3f, 0.7f});
        DirectSample d;
        ASSERT_TRUE(lamp.sample_direct({0, 0, 3}, {a, b}, d));
        const float opacity = lamp.opacity(e.uv, e.prim);
        dark += opacity == 0;
        EXPECT_EQ(e.Le, Rgb(4 * opacity));
        EXPECT_EQ(d.Le, Rgb(4 * lamp.opacity(d.uv, d.prim)));
        const float cosine = 0.5f;
        EXPECT_EQ(lamp.eval_emission({0, 0, 1}, e.uv, e.prim, {std::sqrt(0.75f), 0, cosine}).Le_cos,
                  Rgb(4 * opacity * cosine));
        // A ray that meets the surface sees all of it.
        EXPECT_EQ(lamp.eval_surface({0, 0, 1}, e.uv, e.prim, {0, 0, 1}).Le, Rgb(4));
    }
    EXPECT_GT(dark, 16);
    EXPECT_LT(dark, 48);
}

TEST_F(ExportedScenes, MasksReducePower) {
    const Scene scene = xml(flat_camera() + R"(<shape type="rectangle"><bsdf type="mask">
        <float name="opacity" value="0.25"/><bsdf type="diffuse"/></bsdf>
        <emitter type="area"><rgb name="radiance" value="4"/></emitter></shape>)");
    EXPECT_NEAR(scene.emitter(0).power(), double(kPi) * 4 * 4 * 0.25, 1e-4);
}

TEST_F(ExportedScenes, InvisibleShapesDoNotEmit) {
    EXPECT_NE(
        error_of([&] {
            xml(flat_camera() +
                R"(<shape type="rectangle"><bsdf type="null"/><emitter type="area"/></shape>)");
        }).find("an emitter on a shape with bsdf \"null\""),
        std::string::npos);
}

/// The square with the vertex colours 2, 1, 1, 2 of red and the alphas 0, 1, 1, 0, which are linear in x.
const char* const kShadedSquare =
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float "
    "z\n"
    "property float u\nproperty float v\nproperty float r\nproperty float g\nproperty float b\n"
    "property float a\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
    "-1 -1 0 0 0 2 0 0 0\n1 -1 0 1 0 1 0 0 1\n1 1 0 1 1 1 0 0 1\n-1 1 0 0 1 2 0 0 0\n"
    "3 0 1 2\n3 0 2 3\n";

/// What emitters sample, and what rays see, of an emission and an opacity that are functions of x.
void expect_emission(const Emitter& lamp, const std::function<Rgb(Vec3)>& radiance,
                     const std::function<float(Vec3)>& opacity, double power) {
    EXPECT_NEAR(lamp.power(), power, 0.01 * power);
    for (int i = 0; i < 64; ++i) {
        const double a = (i % 8 + 0.5) / 8, b = (i / 8 + 0.5) / 8;
        const EmissionSample e = lamp.sample_emission({a, b}, {0.3f, 0.7f});
        DirectSample d;
        ASSERT_TRUE(lamp.sample_direct({0, 0, 3}, {a, b}, d));
        const Vec3 up{0, 0, 1};
        expect_colour(e.Le, radiance(e.p) * opacity(e.p), "emission");
        expect_colour(d.Le, radiance(d.p) * opacity(d.p), "next event");
        expect_colour(lamp.eval_emission(up, e.uv, e.prim, up).Le_cos, radiance(e.p) * opacity(e.p),
                      "evaluation");
        expect_colour(lamp.eval_surface(up, e.uv, e.prim, up).Le, radiance(e.p), "hit");
        EXPECT_NEAR(lamp.opacity(e.uv, e.prim), opacity(e.p), 1e-5);
    }
}

TEST_F(ExportedScenes, VertexColoursEmitAndHideEmission) {
    write("square.ply", kShadedSquare);
    const Scene scene =
        xml(flat_camera() +
            fmt::format(R"(<shape type="ply"><string name="filename" value="{}"/><bsdf type="mask">
            <texture type="mesh_attribute" name="opacity"><string name="name" value="vertex_alpha"/></texture>
            <bsdf type="diffuse"/></bsdf><emitter type="area">
            <texture type="mesh_attribute" name="radiance"/></emitter></shape>)",
                        path("square.ply")));
    const auto red = [](Vec3 p) { return Rgb(1.5f - 0.5f * p.x, 0, 0); };
    const auto alpha = [](Vec3 p) { return 0.5f + 0.5f * p.x; };
    // ∫ (1.5 - x/2) (1 + x)/2 dx dy = 2 (1.5 - 1/6) over the square.
    expect_emission(scene.emitter(0), red, alpha,
                    double(kPi * luminance({1, 0, 0})) * 2 * (1.5 - 1.0 / 6));
    for (const float x : {0.1f, 0.4f, 0.8f}) {
        const Vec3 p{2 * x - 1, 0, 0};
        // The mean over twenty decisions.
        EXPECT_NEAR(seen(scene, x, 0.5f).r, red(p).r * alpha(p), 0.026 * double(red(p).r));
    }
}

TEST_F(ExportedScenes, TexturesOfSpaceEmit) {
    const Scene scene = xml(flat_camera() + R"(<shape type="rectangle"><emitter type="area">
        <texture type="checkerboard3d" name="radiance"><rgb name="color0" value="1"/><rgb name="color1" value="3"/>
        <transform name="to_texture"><translate x="2" y="2" z="0.5"/></transform></texture></emitter></shape>)");
    const float left = seen(scene, 0.25f, 0.25f).r;
    EXPECT_TRUE(left == 1 || left == 3);
    expect_emission(
        scene.emitter(0), [&](Vec3 p) { return Rgb((p.x < 0) == (p.y > 0) ? left : 4 - left); },
        [](Vec3) { return 1.0f; }, double(kPi) * 4 * 2);
}

// ---- glTF: several sets of texture coordinates

/// A glowing square with an image of two by two in one set of coordinates and an opacity in another.
TEST_F(ExportedScenes, GltfTexturesHaveSetsOfTheirOwn) {
    Image left(2, 1, {"R", "G", "B", "A"});
    for (int c = 0; c < 4; ++c) left.at(0, 0, c) = 1;
    write("four.png", four_colours());
    write_image(path("left.exr"), left);
    for (const int set_of_image : {0, 1}) {
        GltfDocument d;
        d.add("samplers", {{"magFilter", 9728}});
        for (const char* name : {"four.png", "left.exr"}) {
            d.add("images", {{"uri", name}});
            d.add("textures", {{"source", d.json["images"].size() - 1}, {"sampler", 0}});
        }
        Json material = GltfDocument::glow({1, 1, 1});
        material["emissiveTexture"] = {{"index", 0}, {"texCoord", set_of_image}};
        material["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", 1},
                                                                {"texCoord", 1 - set_of_image}};
        material["alphaMode"] = "MASK";
        // In the other set the square is turned by a quarter, so that the opaque half of the image is the lower one.
        const std::vector<float> plain = {0, 1, 1, 1, 1, 0, 0, 0},
                                 turned = {0, 0, 0, 1, 1, 1, 1, 0};
        d.node(
            {{"mesh", d.square(d.add("materials", material), set_of_image == 0 ? plain : turned,
                               {{"TEXCOORD_1", d.accessor("VEC2", 2, GltfDocument::kFloat,
                                                          set_of_image == 0 ? turned : plain)}})}});
        d.camera();
        expect_quarters(gltf(d), {kBlack, kBlack, kBlue, kWhite});
        d.json["materials"][0]["normalTexture"] = {{"index", 0}, {"texCoord", 2}};
        EXPECT_NE(error_of([&] { gltf(d); }).find("more than 2 sets of texture coordinates"),
                  std::string::npos);
    }
}

// The alpha of vertex colours hides emission as that of the material does.
TEST_F(ExportedScenes, GltfVertexAlphaHidesEmission) {
    GltfDocument d;
    Json glow = GltfDocument::glow({1, 1, 1});
    glow["alphaMode"] = "BLEND";
    const std::vector<float> rgba = {1, 1, 1, 0.25f, 1, 1, 1, 0.75f,
                                     1, 1, 1, 0.75f, 1, 1, 1, 0.25f};
    const Json colors = {{"COLOR_0", d.accessor("VEC4", 4, GltfDocument::kFloat, rgba)}};
    d.node({{"mesh", d.square(d.add("materials", glow), {0, 1, 1, 1, 1, 0, 0, 0}, colors)}});
    d.camera();
    const Scene scene = gltf(d);
    EXPECT_TRUE(scene.warnings().empty());
    expect_emission(
        scene.emitter(0), [](Vec3) { return Rgb(1); }, [](Vec3 p) { return 0.5f + 0.25f * p.x; },
        double(kPi) * 4 * 0.5);
}

}  // namespace
}  // namespace etendue::test
