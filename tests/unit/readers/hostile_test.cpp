// Files that would take far more time or memory than their size lets expect: each is refused with a message, or read
// within the memory that its contents need.

#include <gtest/gtest.h>
#include <sys/mman.h>
#include <zlib.h>

#include <cstring>
#include <filesystem>
#include <fstream>

#include "expect_scene_error.h"
#include "limited_memory.h"
#include "readers/gltf.h"
#include "readers/gzip.h"
#include "readers/mitsuba_values.h"
#include "readers/mitsuba_xml.h"
#include "readers/obj.h"
#include "readers/pbrt.h"
#include "readers/ply.h"
#include "readers/scene_file.h"
#include "readers/serialized.h"

namespace etendue {
namespace {

constexpr uint64_t kMiB = 1 << 20;

std::string repeated(const std::string& text, size_t count) {
    std::string all;
    all.reserve(text.size() * count);
    for (size_t i = 0; i < count; ++i) all += text;
    return all;
}

// -- Meshes.

/// Faces around one vertex, at which each has a texture coordinate of its own.
TEST(HostilePly, CornersOfOneVertexAreSplitInLinearTime) {
    constexpr int kFaces = 200'000;
    std::string text =
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nelement face " +
        std::to_string(kFaces) +
        "\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\n"
        "end_header\n0 0 0\n1 0 0\n0 1 0\n";
    for (int i = 0; i < kFaces; ++i) text += "3 0 1 2 6 " + std::to_string(i) + " 0 0 0 0 1\n";
    const MeshData mesh = parse_ply(text, "fan.ply");
    EXPECT_EQ(mesh.positions.size(), size_t(kFaces) + 2);
    EXPECT_EQ(mesh.uvs[mesh.triangles.back()[0]].x, kFaces - 1);
}

// -- Objects that name another one several times.

/// `levels` objects, each of which names the one before it twice.
std::string doubling(const std::string& element, const std::string& type, const std::string& first,
                     const char* name_a, const char* name_b, int levels) {
    std::string text = "<" + element + " type=\"" + first + "\" id=\"t0\"/>\n";
    for (int i = 1; i <= levels; ++i) {
        const std::string before = "t" + std::to_string(i - 1);
        text += "<" + element + " type=\"" + type + "\" id=\"t" + std::to_string(i) + "\">";
        for (const char* name : {name_a, name_b})
            text += "<ref " + (*name ? "name=\"" + std::string(name) + "\" " : std::string()) +
                    "id=\"" + before + "\"/>";
        text += "</" + element + ">\n";
    }
    return "<scene version=\"3.0.0\">\n" + text + "</scene>";
}

TEST(HostileScenes, ObjectsThatDoubleAreRefused) {
    for (const auto& [element, type, first, a, b] :
         {std::tuple("texture", "checkerboard", "checkerboard", "color0", "color1"),
          std::tuple("bsdf", "blendbsdf", "diffuse", "", ""),
          std::tuple("shape", "merge", "sphere", "", "")}) {
        expect_scene_error(18, "contains more than 100061 objects",
                           [&, e = element, t = type, f = first, x = a, y = b] {
                               parse_mitsuba_xml(doubling(e, t, f, x, y, 60), "s.xml");
                           });
        EXPECT_NO_THROW(parse_mitsuba_xml(doubling(element, type, first, a, b, 10), "s.xml"));
    }
}

TEST(HostileScenes, TexturesOfPbrtThatDoubleOrNestDeeplyAreRefused) {
    const auto scene = [](int levels, const char* second) {
        std::string text = "WorldBegin\nTexture \"t0\" \"spectrum\" \"checkerboard\"\n";
        for (int i = 1; i <= levels; ++i)
            text += "Texture \"t" + std::to_string(i) +
                    "\" \"spectrum\" \"scale\" \"texture tex\" \"t" + std::to_string(i - 1) +
                    "\" \"texture scale\" \"" + second + "\"\n";
        return text;
    };
    EXPECT_NO_THROW(parse_pbrt(scene(40, "t0"), "s.pbrt"));
    EXPECT_THROW(parse_pbrt(scene(20'000, "t0"), "s.pbrt"), SceneError);
    std::string doubled = "WorldBegin\nTexture \"t0\" \"spectrum\" \"checkerboard\"\n";
    for (int i = 1; i <= 50; ++i) {
        const std::string before = "\"t" + std::to_string(i - 1) + "\"";
        doubled += "Texture \"t" + std::to_string(i) +
                   "\" \"spectrum\" \"checkerboard\" \"texture tex1\" " + before +
                   " \"texture tex2\" " + before + "\n";
    }
    EXPECT_THROW(parse_pbrt(doubled, "s.pbrt"), SceneError);
}

// -- pbrt.

const std::string kTetrahedron =
    "Shape \"loopsubdiv\" \"point3 P\" [0 0 0  1 0 0  0 1 0  0 0 1] "
    "\"integer indices\" [0 2 1  0 1 3  1 2 3  2 0 3] \"integer levels\" ";

TEST(HostilePbrt, SubdivisionsAreLimited) {
    const std::string many =
        "WorldBegin\nShape \"loopsubdiv\" \"integer levels\" 8 \"point3 P\" [0 0 0 "
        "1 0 0 0 1 0] \"integer indices\" [" +
        repeated("0 1 2 ", 4096) + "]\n";
    expect_scene_error(2, "8 subdivisions of 4096 triangles would make more than 2^24",
                       [&] { parse_pbrt(many, "s.pbrt"); });
}

TEST(HostilePbrt, SubdivisionsNeedLittleMemory) {
    // 4^8 · 4 = 262144 triangles; at most 1 KB for each.
    EXPECT_EQ(in_limited_memory(
                  256 * kMiB, [] { parse_pbrt("WorldBegin\n" + kTetrahedron + "8\n", "s.pbrt"); }),
              "");
}

TEST(HostilePbrt, SubdivisionsAreThoseOfTheRule) {
    // One step on a tetrahedron: old vertices keep 7/16, and new ones lie on the edges.
    const SceneDescription scene = parse_pbrt("WorldBegin\n" + kTetrahedron + "1\n", "s.pbrt");
    const MeshData& mesh = scene.meshes.at(0);
    ASSERT_EQ(mesh.positions.size(), 10u);
    EXPECT_EQ(mesh.triangles.size(), 16u);
    // By hand: v0 -> 7/16 v0 + 3/16 (v1 + v2 + v3) = (3/16, 3/16, 3/16); the middle of v0 and v1 ->
    // 3/8 (v0 + v1) + 1/8 (v2 + v3) = (3/8, 1/8, 1/8); limit of v0 with w = 1/(3 + 2) = 1/5.
    const Vec3 v0{3 / 16.0f, 3 / 16.0f, 3 / 16.0f};
    const Vec3 m1{3 / 8.0f, 1 / 8.0f, 1 / 8.0f}, m2{1 / 8.0f, 3 / 8.0f, 1 / 8.0f},
        m3{1 / 8.0f, 1 / 8.0f, 3 / 8.0f};
    const Vec3 expected = v0 * 0.4f + (m1 + m2 + m3) * 0.2f;
    EXPECT_LT(length(mesh.positions[0] - expected), 1e-6f);
}

std::string numbers(size_t count) {
    return "[" + repeated("1 ", count) + "]";
}

TEST(HostilePbrt, DeepAttributesShareWhatIsLarge) {
    const std::string deep = repeated("AttributeBegin\n", 4000) + "Shape \"sphere\"\n" +
                             repeated("AttributeEnd\n", 4000);
    const std::string text = "WorldBegin\nAttribute \"texture\" \"float v\" " + numbers(300'000) +
                             "\nNamedMaterial \"" + std::string(300'000, 'm') +
                             "\"\nMediumInterface \"" + std::string(300'000, 'm') + "\" \"\"\n";
    const std::string light =
        "AreaLightSource \"diffuse\" \"spectrum L\" " + numbers(300'000) + "\n";
    EXPECT_EQ(in_limited_memory(200 * kMiB,
                                [&] {
                                    try {
                                        parse_pbrt(text + light + deep, "s.pbrt");
                                    } catch (const SceneError&) {  // the names mean nothing
                                    }
                                }),
              "");
}

TEST(HostilePbrt, MeshesKeepOnlyTheirVertices) {
    const std::string text = "WorldBegin\nAttribute \"shape\" \"point3 P\" [0 0 0 1 0 0 0 1 0 " +
                             repeated("1 1 1 ", 50'000) + "]\n" +
                             repeated("Shape \"trianglemesh\" \"integer indices\" [0 1 2]\n", 200);
    EXPECT_EQ(in_limited_memory(60 * kMiB, [&] { parse_pbrt(text, "s.pbrt"); }), "");
}

TEST(HostilePbrt, ShapesThatBecomeMeshesEndWithTheMemory) {
    if (!kCanLimitMemory) GTEST_SKIP() << "sanitizers need the address space";
    const std::string text =
        "Film \"image\"\nWorldBegin\n" + repeated("Shape \"cone\"\n", 5000) + "WorldEnd\n";
    const std::string verdict = in_limited_memory(200 * kMiB, [&] { parse_pbrt(text, "s.pbrt"); });
    EXPECT_NE(verdict.find("the meshes of the scene need more memory than is free"),
              std::string::npos)
        << verdict;
    EXPECT_TRUE(verdict.starts_with("s.pbrt:")) << verdict;
}

TEST(HostilePbrt, ConstantsThatAreTexturesAreThese) {
    for (const char* type : {"float", "spectrum"}) {
        const std::string a = std::string("Texture \"a\" \"") + type + "\" \"checkerboard\"\n",
                          b = std::string("Texture \"b\" \"") + type +
                              "\" \"constant\" \"texture value\" \"a\"\n",
                          c = std::string("Texture \"c\" \"") + type +
                              "\" \"scale\" \"texture tex\" \"b\"\n";
        const SceneDescription scene = parse_pbrt(
            "WorldBegin\n" + a + b + c +
                (type == std::string("float")
                     ? "Material \"diffuse\" \"texture displacement\" \"b\"\nShape \"sphere\" "
                       "\"texture alpha\" \"b\"\n"
                     : "Material \"diffuse\" \"texture reflectance\" \"b\"\nShape \"sphere\"\n"),
            "s.pbrt");
        EXPECT_EQ(dump(scene).find("constant"), std::string::npos) << dump(scene);
    }
}

TEST(HostilePbrt, ParametersAreLimited) {
    std::string one = "WorldBegin\nShape \"sphere\"", many = "WorldBegin\n";
    for (int i = 0; i < 500; ++i) {
        one += "\n\"float a" + std::to_string(i) + "\" 1";
        many += "Attribute \"shape\" \"float a" + std::to_string(i) + "\" 1\n";
    }
    expect_scene_error(259, "more than 256 parameters", [&] { parse_pbrt(one, "s.pbrt"); });
    expect_scene_error(258, "more than 256 parameters", [&] { parse_pbrt(many, "s.pbrt"); });
}

// -- glTF.

/// A scene of one buffer, b.bin.
SceneDescription read_gltf_text(const std::string& json, const std::string& bytes = {}) {
    ReadOptions options;
    options.read_file = [&](const std::string& path) -> std::optional<std::string> {
        if (path == "b.bin") return bytes;
        return {};
    };
    return parse_gltf(
        "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"uri\":\"b.bin\",\"byteLength\":" +
            std::to_string(bytes.size()) + "}]," + json + "}",
        "s.gltf", options);
}

template <class T>
std::string bytes_of(const std::vector<T>& values) {
    return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

const std::vector<float> kTriangle = {0, 0, 0, 1, 0, 0, 0, 1, 0};

std::string instancing_nodes(int count, int accessor) {
    std::string nodes;
    for (int i = 0; i < count; ++i)
        nodes +=
            std::string(i ? "," : "") +
            R"({"mesh":0,"extensions":{"EXT_mesh_gpu_instancing":{"attributes":{"TRANSLATION":)" +
            std::to_string(accessor) + "}}}}";
    return "\"nodes\":[" + nodes +
           R"(],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],)";
}

TEST(HostileGltf, InstancesAreLimited) {
    const std::string views =
        R"("bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":1200000}],)";
    const std::string accessors =
        R"("accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":3},
           {"componentType":5126,"type":"VEC3","count":1000000},
           {"bufferView":1,"componentType":5126,"type":"VEC3","count":100000}])";
    const std::string bytes = bytes_of(kTriangle) + std::string(1'200'000, '\0');
    expect_scene_error(0, "/accessors/1: has no bufferView",
                       [&] { read_gltf_text(instancing_nodes(1, 1) + views + accessors, bytes); });
    EXPECT_EQ(in_limited_memory(
                  4096 * kMiB,
                  [&] { read_gltf_text(instancing_nodes(100, 2) + views + accessors, bytes); }),
              "s.gltf: /nodes/41: EXT_mesh_gpu_instancing places more than 4194304 meshes in the "
              "scene");
}

/// `count` triangles that are primitives of their own and share the positions of all, with some distance in between.
std::string shared_primitives(int count, int vertices) {
    std::string primitives,
        accessors = R"("accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":)" +
                    std::to_string(vertices) + "}";
    for (int i = 0; i < count; ++i) {
        primitives += std::string(i ? "," : "") +
                      R"({"attributes":{"POSITION":0,"NORMAL":0},"indices":)" +
                      std::to_string(i + 1) + "}";
        accessors +=
            R"(,{"bufferView":1,"componentType":5125,"type":"SCALAR","count":3,"byteOffset":)" +
            std::to_string(12 * i) + "}";
    }
    return "\"nodes\":[{\"mesh\":0}],\"meshes\":[{\"primitives\":[" + primitives + "]}]," +
           accessors + R"(],"bufferViews":[{"buffer":0,"byteLength":)" +
           std::to_string(12 * vertices) + R"(},{"buffer":0,"byteOffset":)" +
           std::to_string(12 * vertices) + R"(,"byteLength":)" + std::to_string(12 * count) + "}]";
}

TEST(HostileGltf, PrimitivesReadTheirOwnVerticesOnly) {
    constexpr int kVertices = 200'000, kPrimitives = 500;
    std::vector<float> positions;
    for (int i = 0; i < kVertices; ++i)
        for (const int x : {i % 400, i / 400, i * 7 % 5}) positions.push_back(float(x));
    std::vector<uint32_t> indices;
    for (uint32_t i = 0; i < kPrimitives; ++i)
        for (const uint32_t v : {0u, 2u, 401u}) indices.push_back(i * 397 + v);
    const std::string bytes = bytes_of(positions) + bytes_of(indices);
    EXPECT_EQ(
        in_limited_memory(
            100 * kMiB, [&] { read_gltf_text(shared_primitives(kPrimitives, kVertices), bytes); }),
        "");
    const SceneDescription scene = read_gltf_text(shared_primitives(kPrimitives, kVertices), bytes);
    ASSERT_EQ(scene.meshes.size(), size_t(kPrimitives));
    const MeshData& last = scene.meshes.back();
    ASSERT_EQ(last.positions.size(), 3u);
    EXPECT_EQ(last.normals.size(), 3u);
    const size_t first = 499 * 397;
    EXPECT_EQ(last.positions[1], (Vec3{positions[3 * (first + 2)], positions[3 * (first + 2) + 1],
                                       positions[3 * (first + 2) + 2]}));
    EXPECT_EQ(last.triangles[0], (MeshData::Triangle{0, 1, 2}));
}

TEST(HostileGltf, DeepJsonIsRefused) {
    expect_scene_error(1, "nested more than 64 deep", [] {
        parse_gltf("{\"asset\":" + std::string(100'000, '[') + std::string(100'000, ']') + "}",
                   "s.gltf");
    });
}

TEST(HostileGltf, ChunksOfFourGigabytesEnd) {
    // A chunk of 2^32 − 8 bytes. Address space for it is not memory: its pages are never touched.
    if (!kCanLimitMemory) GTEST_SKIP() << "sanitizers touch the memory";
    const uint64_t size = 12 + 8 + ((uint64_t(1) << 32) - 8);
    void* at = mmap(nullptr, size, PROT_READ | PROT_WRITE,
                    MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    ASSERT_NE(at, MAP_FAILED);
    char* bytes = static_cast<char*>(at);
    const uint32_t header[] = {0x46546c67, 2, 0xffffffff, uint32_t(-8), 0x004e4942};
    std::memcpy(bytes, header, sizeof header);
    const std::string verdict = in_limited_memory(kMiB * 64, [&] {
        parse_gltf({bytes, size}, "s.glb");
    });
    munmap(at, size);
    EXPECT_EQ(verdict, "s.glb: the file has no JSON chunk");
}

// -- Texts with marks of their encoding.

TEST(MarkedTexts, Utf8IsReadAndUtf16IsNamed) {
    const std::string mark = "\xef\xbb\xbf";
    const std::string obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    EXPECT_EQ(parse_obj(mark + obj, "f.obj").positions.size(), 3u);
    EXPECT_EQ(parse_pbrt(mark + "WorldBegin\nShape \"sphere\"\n", "s.pbrt").roots.size(), 3u);
    EXPECT_EQ(parse_spectrum_file(mark + "400 1\n700 2\n", "f.spd").values.size(), 2u);
    EXPECT_NO_THROW(parse_mitsuba_xml(mark + "<scene version=\"3.0.0\"></scene>", "s.xml"));
    for (const std::string& other : {std::string("\xff\xfe") + "v\0"}) {
        const auto expect_named = [&](const auto& parse) {
            expect_scene_error(1, "the file is in UTF-16; save it as UTF-8", parse);
        };
        expect_named([&] { parse_obj(other, "f.obj"); });
        expect_named([&] { parse_pbrt(other, "s.pbrt"); });
        expect_named([&] { parse_spectrum_file(other, "f.spd"); });
        expect_named([&] { parse_mitsuba_xml(other, "s.xml"); });
    }
}

// -- Compressed data.

std::string gzip(const std::string& text) {
    z_stream stream{};
    deflateInit2(&stream, 9, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY);
    std::string out(deflateBound(&stream, uLong(text.size())), '\0');
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
    stream.avail_in = uInt(text.size());
    stream.next_out = reinterpret_cast<Bytef*>(out.data());
    stream.avail_out = uInt(out.size());
    deflate(&stream, Z_FINISH);
    out.resize(out.size() - stream.avail_out);
    deflateEnd(&stream);
    return out;
}

/// As many members as there are megabytes.
std::string gzip_of_blanks(size_t megabytes) {
    return repeated(gzip(std::string(1 << 20, ' ')), megabytes);
}

TEST(HostileCompression, GzipIsLimitedByItsSize) {
    const std::string fine = gzip_of_blanks(4);
    EXPECT_EQ(unpack_gzip(fine, "f.gz").size(), size_t(4 << 20));
    const std::string bomb = gzip_of_blanks(300);
    expect_scene_error(0, "more than 200 times as large as the file",
                       [&] { unpack_gzip(bomb, "f.gz"); });
}

TEST(Compression, AllSceneFilesMayBePacked) {
    const std::filesystem::path folder =
        std::filesystem::path(::testing::TempDir()) / ("packed-" + std::to_string(getpid()));
    std::filesystem::create_directories(folder);
    for (const auto& [name, text] : std::vector<std::pair<const char*, std::string>>{
             {"s.xml.gz", "<scene version=\"3.0.0\"><shape type=\"sphere\"/></scene>"},
             {"s.pbrt.gz", "WorldBegin\nShape \"sphere\"\n"},
             {"s.gltf.gz", R"({"asset":{"version":"2.0"}})"}}) {
        const std::string file = (folder / name).string();
        std::ofstream(file, std::ios::binary) << gzip(text);
        EXPECT_NO_THROW(read_scene_file(file)) << name;
    }
    std::filesystem::remove_all(folder);
}

TEST(HostileCompression, GzipEndsWithTheMemory) {
    if (!kCanLimitMemory) GTEST_SKIP() << "sanitizers need the address space";
    const std::string packed = gzip_of_blanks(200);
    EXPECT_EQ(in_limited_memory(150 * kMiB, [&] { unpack_gzip(packed, "f.gz"); }),
              "f.gz: cannot unpack the gzip data: there is too little memory");
}

/// A .serialized file whose only mesh has these uncompressed contents, followed by zeros.
std::string serialized(const std::string& contents, size_t zeros) {
    std::string out("\x1c\x04\x04\x00", 4);
    const size_t begin = out.size();
    out.resize(begin + contents.size() + zeros / 500 + 1000);
    z_stream stream{};
    deflateInit(&stream, 1);
    stream.next_out = reinterpret_cast<Bytef*>(&out[begin]);
    stream.avail_out = uInt(out.size() - begin);
    const auto add = [&](const std::string& bytes) {
        stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
        stream.avail_in = uInt(bytes.size());
        deflate(&stream, Z_NO_FLUSH);
    };
    add(contents);
    const std::string piece(1 << 20, '\0');
    for (size_t done = 0; done < zeros; done += piece.size()) add(piece);
    deflate(&stream, Z_FINISH);
    out.resize(out.size() - stream.avail_out);
    deflateEnd(&stream);
    return out + std::string(8, '\0') + std::string("\x01\x00\x00\x00", 4);
}

template <class T>
std::string raw(T value) {
    return {reinterpret_cast<const char*>(&value), sizeof value};
}

TEST(HostileCompression, MeshesAreLimitedByTheirSize) {
    const std::string head = raw<uint32_t>(0x1000) + std::string("m\0", 2);
    const std::string many =
        serialized(head + raw<uint64_t>(100'000'000) + raw<uint64_t>(1), size_t(16) << 20);
    expect_scene_error(0, "the mesh has 100000000 vertices and 1 triangles, which is more than",
                       [&] { parse_serialized(many, "f.serialized", 0); });
    const std::string name =
        serialized(raw<uint32_t>(0x1000) + std::string(1 << 20, 'n') + std::string(1, '\0'), 0);
    expect_scene_error(0, "the name of the mesh has no end",
                       [&] { parse_serialized(name, "f.serialized", 0); });
}

/// Bytes that this process has read from files.
uint64_t bytes_read() {
    std::ifstream in("/proc/self/io");
    std::string name;
    uint64_t bytes = 0;
    in >> name >> bytes;
    return bytes;
}

TEST(LargeFiles, OneMeshOfManyIsReadAlone) {
    // 1000 meshes: the file is read once altogether, not once for each.
    const std::string head = raw<uint32_t>(0x1000) + std::string("m\0", 2);
    constexpr uint64_t kVertices = 1000;
    std::string contents = head + raw<uint64_t>(kVertices) + raw<uint64_t>(1);
    for (uint64_t i = 0; i < 3 * kVertices; ++i) contents += raw(float(i * i % 1009));
    for (const uint32_t v : {0u, 1u, 2u}) contents += raw(v);
    const std::string one = serialized(contents, 0);
    const std::string mesh = one.substr(0, one.size() - 12);
    constexpr uint64_t kMeshes = 1000;
    std::string file, table;
    for (uint64_t i = 0; i < kMeshes; ++i) {
        table += raw<uint64_t>(file.size());
        file += mesh;
    }
    file += table + raw<uint32_t>(kMeshes);
    const std::string path = (std::filesystem::path(::testing::TempDir()) /
                              ("many-" + std::to_string(getpid()) + ".serialized"))
                                 .string();
    std::ofstream(path, std::ios::binary) << file;
    const uint64_t before = bytes_read();
    for (const int i : {0, 1, 500, 998, 999})
        EXPECT_EQ(read_serialized(path, i).triangles.size(), 1u);
    const uint64_t read = bytes_read() - before;
    std::filesystem::remove(path);
    EXPECT_GT(read, 5 * mesh.size() / 2);
    EXPECT_LT(read, file.size() / 10);
}

}  // namespace
}  // namespace etendue
