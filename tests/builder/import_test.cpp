// load_mesh(): each format, transforms, and what it refuses.
#include "builder/job.hpp"
#include "builder/polygons.hpp"

#include <prolate/mesh.hpp>
#include <prolate/rig.hpp>

#include <assimp/Exporter.hpp>
#include <assimp/Importer.hpp>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <limits>
#include <utility>

#include <sys/stat.h>
#include <unistd.h>

namespace prolate {
namespace {

namespace fs = std::filesystem;

constexpr const char* kObj = "v 0 0 0\nv 1.5 0 0\nv 0 1.25 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
constexpr double kVolume = 1.5 * 1.25 / 6;

double signed_volume(const Mesh& mesh) {
    double six = 0;
    for (const Triangle& t : mesh.triangles) {
        const Vec3 &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
        six += a.x * (double{b.y} * c.z - double{b.z} * c.y) - a.y * (double{b.x} * c.z - double{b.z} * c.x) +
               a.z * (double{b.x} * c.y - double{b.y} * c.x);
    }
    return six / 6;
}

class Import : public ::testing::Test {
protected:
    void SetUp() override {
        std::string name = (fs::temp_directory_path() / "prolate-import-XXXXXX").string();
        ASSERT_NE(::mkdtemp(name.data()), nullptr);
        folder_ = name;
    }
    void TearDown() override { fs::remove_all(folder_); }

    std::string write(const std::string& name, std::string_view content) const {
        const std::string path = (folder_ / name).string();
        std::ofstream(path, std::ios::binary).write(content.data(), static_cast<std::streamsize>(content.size()));
        return path;
    }
    static std::string read(const std::string& path) {
        std::ifstream file(path, std::ios::binary);
        return {std::istreambuf_iterator<char>(file), {}};
    }
    // The tetrahedron in one of Assimp's export formats.
    std::string exported(const char* format, const std::string& name) const {
        Assimp::Importer importer;
        const aiScene* scene = importer.ReadFile(write("source.obj", kObj), aiProcess_JoinIdenticalVertices);
        Assimp::Exporter exporter;
        const std::string path = (folder_ / name).string();
        EXPECT_EQ(exporter.Export(scene, format, path), aiReturn_SUCCESS) << exporter.GetErrorString();
        return path;
    }
    Mesh load(const std::string& path) const {
        ImportReport report;
        return load(path, {}, report);
    }
    Mesh load(const std::string& path, const ImportOptions& options, ImportReport& report) const {
        auto mesh = load_mesh(path.c_str(), options, &report);
        EXPECT_TRUE(mesh) << path << ": " << (mesh ? "" : mesh.error().what) << ' ' << report.detail;
        return mesh ? std::move(*mesh) : Mesh{};
    }
    void expect_tetrahedron(const std::string& path) const {
        const Mesh mesh = load(path);
        ASSERT_EQ(mesh.triangles.size(), 4u) << path;
        const auto cleaned = clean(mesh.view());
        ASSERT_TRUE(cleaned) << path;
        EXPECT_TRUE(cleaned->report.closed) << path;
        ASSERT_EQ(cleaned->mesh.vertices.size(), 4u) << path;
        EXPECT_NEAR(signed_volume(mesh), kVolume, 1e-6) << path;
        for (const Vec3 expected : {Vec3{0, 0, 0}, {1.5f, 0, 0}, {0, 1.25f, 0}, {0, 0, 1}})
            EXPECT_EQ(std::count(cleaned->mesh.vertices.begin(), cleaned->mesh.vertices.end(), expected), 1)
                << path << ": coordinates stay as the file has them";
    }
    void expect_refused(const std::string& path, ErrorCode code, const std::string& words) const {
        ImportReport report;
        const auto mesh = load_mesh(path.c_str(), {}, &report);
        ASSERT_FALSE(mesh) << path;
        EXPECT_EQ(mesh.error().code, code) << path << ": " << mesh.error().what;
        EXPECT_NE((mesh.error().what + (" " + report.detail)).find(words), std::string::npos)
            << path << ": " << mesh.error().what << " / " << report.detail;
    }

    fs::path folder_;
};

constexpr const char* kOff =
    "OFF\n# a comment\n4 4 6\n0 0 0\n1.5 0 0\n0 1.25 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n";

struct Format {
    const char *id, *name;
};
constexpr Format kFormats[] = {{"ply", "a.ply"},    {"plyb", "b.ply"}, {"stl", "a.stl"}, {"stlb", "b.stl"},
                               {"gltf2", "a.gltf"}, {"glb2", "a.glb"}, {"3ds", "a.3ds"}, {"collada", "a.dae"}};

TEST_F(Import, ReadsEveryFormat) {
    expect_tetrahedron(write("a.obj", kObj));
    expect_tetrahedron(write("UPPER.OBJ", kObj));
    expect_tetrahedron(write("a.off", kOff));
    for (const Format& format : kFormats) expect_tetrahedron(exported(format.id, format.name));
}

// A file that ends too early never gives a mesh with triangles missing.
TEST_F(Import, EveryPrefixOfEveryFormatIsRefusedOrWhole) {
    const auto check = [&](const std::string& path) {
        const std::string whole = read(path);
        ASSERT_FALSE(whole.empty());
        const std::string cut_path = (folder_ / ("cut" + fs::path(path).extension().string())).string();
        size_t tried = 0, refused = 0;
        // Every prefix of small files, and of the last part of larger ones; in between, a stride to save time.
        for (size_t size = 0; size < whole.size(); size += whole.size() - size < 600 ? 1 : 7, ++tried) {
            fs::remove(cut_path); // some file systems wait for the disk where a file is cut to be written again
            std::ofstream(cut_path, std::ios::binary).write(whole.data(), static_cast<std::streamsize>(size));
            const auto mesh = load_mesh(cut_path.c_str());
            refused += !mesh;
            // An OBJ does not say how many faces it has: cut after a whole line, it is a sound but open mesh.
            if (mesh && cut_path.ends_with(".obj")) {
                const bool at_face = size > 0 && (whole[size] == '\n' || whole[size - 1] == '\n');
                EXPECT_TRUE(at_face) << "cut at " << size;
            } else if (mesh) {
                EXPECT_EQ(mesh->triangles.size(), 4u) << path << " cut at " << size;
            }
        }
        EXPECT_GT(refused, tried / 2) << path;
    };
    check(write("a.obj", kObj));
    check(write("a.off", kOff));
    for (const Format& format : kFormats) check(exported(format.id, format.name));
}

TEST_F(Import, ReadsObjVariants) {
    const std::string vertices = "v 0 0 0\nv 1.5 0 0\nv 0 1.25 0\nv 0 0 1\n";
    expect_tetrahedron(write("negative.obj", vertices + "f -4 -2 -3\nf -4 -3 -1\nf -3 -2 -1\nf -2 -4 -1\n"));
    expect_tetrahedron(write("windows.obj", "v 0 0 0\r\nv 1.5 0 0\r\nv 0 1.25 0\r\nv 0 0 1\r\nf 1 3 2\r\nf 1 2 4\r\n"
                                            "f 2 3 4\r\nf 3 1 4\r\n"));
    expect_tetrahedron(write("joined.obj", vertices + "f 1 \\\n3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4"));
    expect_tetrahedron(write("slashes.obj", "mtllib missing.mtl\no a\n" + vertices +
                                                "vn 0 0 1\nusemtl red\nf 1//1 3//1 2//1\nf 1//1 2//1 4//1\ng b\n"
                                                "s off\nf 2//1 3//1 4//1\nf 3//1 1//1 4//1\n"));
    const Mesh quads = load(write("quads.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nl 1 2\np 3\nf 1 2 3 4\n"));
    EXPECT_EQ(quads.triangles.size(), 2u) << "polygons become triangles; points and lines are left out";
}

TEST_F(Import, AFilesHashStandsForItsMesh) {
    const auto hash = [](const std::string& path) { return hash_mesh_file(path.c_str()); };
    const std::string path = write("a.obj", kObj);
    ASSERT_TRUE(hash(path));
    EXPECT_EQ(hash(path), hash(write("b.OBJ", kObj)));
    EXPECT_NE(hash(path), hash(write("c.obj", std::string(kObj) + "\n")));
    EXPECT_NE(hash(path), hash(write("d.ply", kObj))) << "another reader makes another mesh of it";
    EXPECT_FALSE(hash((folder_ / "missing.obj").string()));
    EXPECT_FALSE(hash(folder_.string()));

    // A GLB holds its numbers itself, unless its JSON names a file; a .gltf may, so a mesh of it is read to be known.
    const auto glb = [this](const std::string& name, const std::string& json, const std::string& rest) {
        std::string bytes = "glTF0123abcd"; // the header's numbers do not matter here
        const auto length = static_cast<uint32_t>(json.size());
        bytes.append(reinterpret_cast<const char*>(&length), sizeof length);
        return write(name, bytes + "JSON" + json + rest);
    };
    EXPECT_TRUE(hash(glb("a.glb", R"({"buffers": [{"byteLength": 8}]})", "numbers with uri and \\ by chance")));
    EXPECT_FALSE(hash(glb("b.glb", R"({"buffers": [{"uri": "a.bin"}]})", "")));
    EXPECT_FALSE(hash(glb("c.glb", R"({"buffers": [{"\u0075ri": "a.bin"}]})", "")));
    EXPECT_FALSE(hash(write("short.glb", "glTF0123abcd")));
    EXPECT_FALSE(hash(write("a.gltf", R"({"buffers": [{"uri": "a.bin"}]})")));
    EXPECT_TRUE(hash(write("b.gltf", R"({"buffers": []})")));
}

TEST_F(Import, RefusesDamagedObj) {
    const std::string vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    expect_refused(write("a.obj", vertices + "f 1 2"), ErrorCode::bad_file, "line 4");
    expect_refused(write("b.obj", vertices + "f 1 2 3\nf 1/"), ErrorCode::bad_file, "line 5");
    expect_refused(write("c.obj", "v 0 0 0\nv 1 0\nv 0 1 0\nf 1 2 3\n"), ErrorCode::bad_file, "line 2");
    expect_refused(write("d.obj", vertices + "f 1 2 4\n"), ErrorCode::bad_file, "does not exist");
    expect_refused(write("e.obj", vertices + "f 0 1 2\n"), ErrorCode::bad_file, "does not exist");
    expect_refused(write("f.obj", vertices + "f -1 -2 -4\n"), ErrorCode::bad_file, "does not exist");
    expect_refused(write("g.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), ErrorCode::bad_file, "line 1");
    expect_refused(write("h.obj", "v 0 0 x\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), ErrorCode::bad_file, "line 1");
    expect_refused(write("i.obj", vertices), ErrorCode::bad_file, "no triangles");
    expect_refused(write("j.obj", vertices + "l 1 2\n"), ErrorCode::bad_file, "no triangles");
    expect_refused(write("k.obj", "\x89PNG\r\n\x1a\n binary rubbish"), ErrorCode::bad_file, "");
}

TEST_F(Import, RefusesWhatAssimpWouldBend) {
    expect_refused(write("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n"), ErrorCode::bad_file, "does not exist");
    expect_refused(write("b.off", "OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"), ErrorCode::bad_file, "line 7");
    expect_refused(write("c.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n0\n"), ErrorCode::bad_file, "corners");
    const std::string header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                               "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
    EXPECT_EQ(load(write("good.ply", header + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")).triangles.size(), 1u);
    expect_refused(write("a.ply", header + "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n"), ErrorCode::bad_file, "does not exist");
    expect_refused(write("b.ply", header + "0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n"), ErrorCode::bad_file, "does not exist");
    expect_refused(write("c.ply", header + "0 0 0\n1 0 0\n0 1 0\n0\n"), ErrorCode::bad_file, "corners");
    expect_refused(write("d.ply", header + "0 0 0\n1 0 0\n"), ErrorCode::bad_file, "cut short");
    expect_refused(write("e.ply", "ply\nformat ascii 1.0\nelement nothing 4000000000\nend_header\n"),
                   ErrorCode::bad_file, "without properties");
    expect_refused(write("a.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
                                  "vertex 0 1 0\nendloop\nendfacet\n"),
                   ErrorCode::bad_file, "cut short");
}

TEST_F(Import, RefusesWhatIsNoFile) {
    ImportReport report{"old", {"old"}, {"old"}};
    auto mesh = load_mesh((folder_ / "missing.obj").c_str(), {}, &report);
    ASSERT_FALSE(mesh);
    EXPECT_EQ(mesh.error().code, ErrorCode::io);
    EXPECT_EQ(mesh.error().where, static_cast<uint64_t>(ENOENT));
    EXPECT_EQ(report.detail, "");
    EXPECT_TRUE(report.notes.empty());
    EXPECT_TRUE(report.files.empty());
    fs::create_directory(folder_ / "folder.obj");
    mesh = load_mesh((folder_ / "folder.obj").c_str());
    ASSERT_FALSE(mesh);
    EXPECT_EQ(mesh.error().code, ErrorCode::io);
    EXPECT_EQ(mesh.error().where, static_cast<uint64_t>(EISDIR));
    for (const char* name : {"e.obj", "e.ply", "e.stl", "e.off", "e.gltf", "e.glb", "e.3mf", "e.3ds", "e.dae"})
        expect_refused(write(name, ""), ErrorCode::bad_file, "empty");
    expect_refused(write("mesh.xyz", kObj), ErrorCode::bad_file, "unknown kind");
    expect_refused(write("mesh", kObj), ErrorCode::bad_file, "unknown kind");
    if (::geteuid() != 0) { // root reads everything
        const std::string path = write("secret.obj", kObj);
        fs::permissions(path, fs::perms::none);
        expect_refused(path, ErrorCode::io, "cannot open");
    }
    for (const char* name : {"r.ply", "r.stl", "r.off", "r.gltf", "r.glb", "r.3ds", "r.dae"})
        expect_refused(write(name, "this is rubbish, not a mesh"), ErrorCode::bad_file, "");
}

// A COLLADA scene: the tetrahedron under `nodes`, in inches and with z up, neither of which is applied.
std::string dae(const std::string& nodes) {
    return R"(<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset><unit name="inch" meter="0.0254"/><up_axis>Z_UP</up_axis></asset>
  <library_geometries><geometry id="g"><mesh>
    <source id="p"><float_array id="pa" count="12">0 0 0 1.5 0 0 0 1.25 0 0 0 1</float_array>
      <technique_common><accessor source="#pa" count="4" stride="3"><param name="X" type="float"/>
      <param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
    <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
    <triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/><p>0 2 1 0 1 3 1 2 3 2 0 3</p></triangles>
  </mesh></geometry></library_geometries>
  <library_visual_scenes><visual_scene id="s">)" +
           nodes + R"(</visual_scene></library_visual_scenes>
  <scene><instance_visual_scene url="#s"/></scene>
</COLLADA>
)";
}

constexpr const char* kDaeNode = R"(<node id="n"><instance_geometry url="#g"/></node>)";

std::string with(std::string text, std::string_view old, std::string_view by) {
    const size_t at = text.find(old);
    EXPECT_NE(at, text.npos) << old;
    return text.replace(at, old.size(), by);
}

TEST_F(Import, DaeWithIndicesThatAreNoNumbersIsRefused) {
    const std::string good = dae(kDaeNode);
    const auto corners = [&](const std::string& list) {
        return write("p.dae", with(good, "<p>0 2 1 0 1 3 1 2 3 2 0 3</p>", list));
    };
    for (const char* list :
         {"<p>0 2 1 0 1 3 1 nan 3 2 0 3</p>", "<p\n>0 2 1 0 1 3 1 2 3 2 0 3-</p>", "<p>0 2 1 0 1 3 1.0 2 3 2 0 3</p>",
          "<p>-1 2 1 0 1 3 1 2 3 2 0 3</p>", "<p>0 2 1<![CDATA[nan]]></p>", "<p>0 2 1 0 1 3 1 2 3 2 0 1e39</p>",
          "<p>0 2 1 0 1 3 1 2 3 2 0 99999999999999999999999</p>"})
        expect_refused(corners(list), ErrorCode::bad_file, "not numbers");
    expect_refused(corners("<p>0 2 1 0 1 3 1 2 3 2 0 4</p>"), ErrorCode::bad_file, "does not exist line 9, <p>");
    expect_refused(corners("<p>0 2 1 0 1 3 <b>1</b> 2 3 2 0 3</p>"), ErrorCode::bad_file, "other elements");
    expect_refused(corners("<p>0 2 1 0 1 3 1 2 3 2 0</p>"), ErrorCode::bad_file, "another number");
    expect_refused(corners("<p>0 2 1 0 1 3 1 2 3</p>"), ErrorCode::bad_file, "another number");
    expect_refused(corners(""), ErrorCode::bad_file, "another number");
    expect_tetrahedron(corners("<p>\n0 2 1\t0 1 3\r\n1 2 3 <!-- and the last --><![CDATA[2 0 3]]> </p>"));
}

// What Assimp 5.2 reads beyond the end of, or follows until the stack is full.
TEST_F(Import, HostileDaeIsRefusedByPlaceAndName) {
    const std::string good = dae(kDaeNode);
    const auto refuse = [&](std::string_view old, std::string_view by, const std::string& words) {
        expect_refused(write("h.dae", with(good, old, by)), ErrorCode::bad_file, words);
    };
    const std::string accessor = R"(source="#pa" count="4" stride="3")";
    for (const char* beyond :
         {R"(source="#pa" count="5" stride="3")", R"(source="#pa" count="4" stride="4")",
          R"(source="#pa" count="4" stride="3" offset="1")", R"(source="#pa" count="4" stride="2")",
          R"(source="#pa" count="4" stride="0")", R"(source="#pa" count="18446744073709551615" stride="3")",
          R"(source="#pa" count="4" stride="18446744073709551615")",
          R"(source="#pa" count="4" stride="3" offset="18446744073709551615")"})
        refuse(accessor, beyond, "reaches beyond its array line 6, <accessor>");
    refuse(accessor, R"(source="#pa" count="1e39" stride="3")", "not a number");
    refuse(accessor, R"(source="#pa" count="-4" stride="3")", "not a number");
    refuse(accessor, R"(source="#pa" stride="3")", "missing");
    refuse(accessor, R"(source="#nowhere" count="4" stride="3")", "does not exist");
    refuse(accessor, R"(source="other.dae#pa" count="4" stride="3")", "another file");
    refuse(R"(count="12")", R"(count="13")", "another length");
    refuse("0 0 0 1.5 0 0", "0 0 0 1.5 0 x", "not numbers");
    refuse("0 0 0 1.5 0 0", "0 0 0 nan 0 0", "not finite");
    refuse(R"(name="Y")", R"(name="T")", "without X, Y and Z");
    refuse(R"(semantic="VERTEX")", R"(semantic="NORMAL")", "without vertices");
    refuse(R"(semantic="POSITION")", R"(semantic="NORMAL")", "without positions");
    refuse(R"(source="#v" offset="0")", R"(source="#v" offset="4000000000")", "offset out of range");
    refuse(R"(source="#v" offset="0")", R"(source="#v" offset="8")", "ends within a corner");
    refuse(R"(<triangles count="4">)", R"(<triangles count="4000000000">)", "another number");
    refuse(R"(url="#s")", R"(url="#g")", "does not exist");
    refuse("<scene>", "<scene/><nothing>", "cannot be read as COLLADA");
    refuse(R"(<instance_visual_scene url="#s"/>)", "", "no scene");
    refuse(R"(<vertices id="v">)", R"(<vertices id="v"/><vertices id="v">)", "several elements");
    refuse("</mesh>", "</mesh><brep/>", "boundary representation");

    const auto refuse_nodes = [&](const std::string& nodes, const std::string& words) {
        expect_refused(write("n.dae", dae(nodes)), ErrorCode::bad_file, words);
    };
    refuse_nodes(R"(<node id="a"><instance_node url="#a"/></node>)", "in a circle line 11, <instance_node>");
    refuse_nodes(R"(<node id="a"><node id="b"><instance_node url="#a"/><instance_node url="#a"/></node></node>)",
                 "in a circle");
    refuse_nodes(R"(<node><translate>1 2</translate></node>)", "wrong number of numbers");
    refuse_nodes(R"(<node><matrix>1 0 0 0 0 1 0 0 0 0 1 0 0 0 1 1</matrix></node>)", "perspective");
    refuse_nodes(R"(<node><skew>45 0 1 0 1 0 0</skew></node>)", "a skew");
    refuse_nodes(R"(<node><instance_geometry url="b.dae#g"/></node>)", "another file");
    refuse_nodes(R"(<node><instance_controller url="#c"/></node>)", "does not exist");
    // Nodes deep within each other are no circle.
    std::string deep = kDaeNode;
    for (int i = 0; i < 20000; ++i) deep = "<node>" + deep + "</node>";
    expect_tetrahedron(write("deep.dae", dae(deep)));
}

TEST_F(Import, DaeHasPolygonsStripsAndFans) {
    const std::string good = dae(kDaeNode), old = R"(<triangles count="4">)", end = "</triangles>";
    const auto primitives = [&](const std::string& kind, const std::string& count, const std::string& lists) {
        std::string text = with(with(good, old, "<" + kind + " count=\"" + count + "\">"), end, "</" + kind + ">");
        return write("k.dae", with(text, "<p>0 2 1 0 1 3 1 2 3 2 0 3</p>", lists));
    };
    expect_tetrahedron(primitives("polylist", "5", "<vcount>3 3 2 3 3</vcount><p>0 2 1 0 1 3 0 1 1 2 3 2 0 3</p>"));
    expect_tetrahedron(primitives("polygons", "4", "<p>0 2 1</p><p>0 1 3</p><p>1 2 3</p><p>2 0 3</p>"));
    expect_tetrahedron(primitives("tristrips", "1", "<p>0 2 1 3 0 2</p>"));
    expect_tetrahedron(primitives("trifans", "2", "<p>3 2 0 1 2</p><p>0 2 1</p>"));
    const std::string polygons = "<vcount>3 3 3 3</vcount><p>0 2 1 0 1 3 1 2 3 2 0 3</p>";
    expect_refused(primitives("polylist", "3", polygons), ErrorCode::bad_file, "another number");
    expect_refused(primitives("polylist", "4", with(polygons, "3 3 3 3", "3 3 3 4294967295")), ErrorCode::bad_file,
                   "without its corners");
    expect_refused(primitives("polylist", "3", with(polygons, "3 3 3 3", "3 3 3")), ErrorCode::bad_file, "no polygon");
    expect_refused(primitives("polylist", "4", with(polygons, "3 3 3 3", "3 3 3 x")), ErrorCode::bad_file,
                   "not numbers");
    expect_refused(primitives("polygons", "1", "<ph><p>0 2 1</p><h>0 1 3</h></ph>"), ErrorCode::bad_file, "holes");
    expect_refused(primitives("lines", "4", "<p>0 2</p>"), ErrorCode::bad_file, "no triangles");
}

// A node's transforms in all their forms: each takes the tetrahedron to the same place.
TEST_F(Import, DaeTransforms) {
    for (const char* node : {"<translate>10 0 0</translate><rotate>0 0 2 90</rotate><scale>2 2 2</scale>",
                             "<matrix>0 -2 0 10  2 0 0 0  0 0 2 0  0 0 0 1</matrix>",
                             "<lookat>10 0 0 10 0 -1 -1 0 0</lookat><scale>2 2 2</scale><rotate>1 0 0 0</rotate>"}) {
        const Mesh mesh =
            load(write("t.dae", dae("<node>" + std::string(node) + "<instance_geometry url=\"#g\"/></node>")));
        EXPECT_NEAR(signed_volume(mesh), 8 * kVolume, 1e-5) << node;
        Vec3 low = {99, 99, 99}, high = {-99, -99, -99};
        for (const Vec3& v : mesh.vertices) {
            low = {std::min(low.x, v.x), std::min(low.y, v.y), std::min(low.z, v.z)};
            high = {std::max(high.x, v.x), std::max(high.y, v.y), std::max(high.z, v.z)};
        }
        EXPECT_NEAR(low.x, 7.5f, 1e-6) << node;
        EXPECT_NEAR(high.x, 10, 1e-6) << node;
        EXPECT_NEAR(low.y, 0, 1e-6) << node;
        EXPECT_NEAR(high.y, 3, 1e-6) << node;
        EXPECT_NEAR(high.z, 2, 1e-6) << node;
    }
}

TEST_F(Import, DaeControllersAreTakenInTheirBaseShape) {
    const std::string controllers = R"(<library_controllers>
      <controller id="c"><skin source="#m"/></controller><controller id="m"><morph source="#g"/></controller>
      <controller id="o"><skin source="#o"/></controller></library_controllers><library_visual_scenes>)";
    const auto file = [&](const std::string& name) {
        return write("c.dae", with(dae("<node><instance_controller url=\"#" + name + "\"/></node>"),
                                   "<library_visual_scenes>", controllers));
    };
    expect_tetrahedron(file("c"));
    ImportReport report;
    load(file("c"), {.unit = 0.0254}, report);
    ASSERT_EQ(report.notes.size(), 2u);
    EXPECT_TRUE(report.notes[1].starts_with("1 skinned or morphed")) << report.notes[1];
    expect_refused(file("o"), ErrorCode::bad_file, "circle");
}

TEST_F(Import, DaeKeepsTheFilesUnitAndAxes) {
    expect_tetrahedron(write("plain.dae", dae(kDaeNode)));
}

TEST_F(Import, AppliesNestedTransformsAndInstances) {
    const Mesh mesh = load(write("instances.dae", dae(R"(
        <node id="a"><instance_geometry url="#g"/></node>
        <node id="b"><translate>10 0 0</translate>
          <node id="c"><scale>2 2 2</scale><instance_geometry url="#g"/></node></node>)")));
    ASSERT_EQ(mesh.triangles.size(), 8u);
    EXPECT_NEAR(signed_volume(mesh), 9 * kVolume, 1e-5);
    float low = 99, high = -99;
    for (const Vec3& v : mesh.vertices) low = std::min(low, v.x), high = std::max(high, v.x);
    EXPECT_EQ(low, 0);
    EXPECT_EQ(high, 13);
}

TEST_F(Import, MirroredInstancesKeepTheirOutside) {
    const Mesh mesh = load(write("mirror.dae", dae(R"(
        <node id="a"><scale>1 1 -1</scale><instance_geometry url="#g"/>
          <node id="b"><translate>5 0 0</translate><scale>-1 1 1</scale><instance_geometry url="#g"/></node></node>)")));
    ASSERT_EQ(mesh.triangles.size(), 8u);
    EXPECT_NEAR(signed_volume(mesh), 2 * kVolume, 1e-6) << "a mirrored mesh, and one mirrored twice";
    const auto cleaned = clean(mesh.view());
    ASSERT_TRUE(cleaned);
    EXPECT_TRUE(cleaned->report.closed);
}

TEST_F(Import, GltfNodesAreApplied) {
    // One triangle in an embedded buffer: 3 floats each for (0,0,0) (1,0,0) (0,1,0), used by two nodes.
    const auto gltf = [](const std::string& nodes, const std::string& roots) {
        return R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":)" + roots + R"(}],"nodes":)" + nodes +
               R"(,"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
               "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}],
               "bufferViews":[{"buffer":0,"byteLength":36}],
               "buffers":[{"byteLength":36,"uri":"data:application/octet-stream;base64,)"
               R"(AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]})";
    };
    const Mesh one = load(write("one.gltf", gltf(R"([{"mesh":0,"translation":[0,0,7]}])", "[0]")));
    ASSERT_EQ(one.triangles.size(), 1u);
    for (const Vec3& v : one.vertices) EXPECT_EQ(v.z, 7) << "the root's own transform counts in glTF";
    const Mesh two =
        load(write("two.gltf", gltf(R"([{"mesh":0,"scale":[-1,1,1]},{"mesh":0,"translation":[0,0,2]}])", "[0,1]")));
    ASSERT_EQ(two.triangles.size(), 2u);
    for (const Triangle& t : two.triangles) { // both face +z
        const Vec3 &a = two.vertices[t[0]], &b = two.vertices[t[1]], &c = two.vertices[t[2]];
        EXPECT_GT((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x), 0);
    }
}

TEST_F(Import, GltfWithAShortBufferIsRefused) {
    const std::string path = exported("gltf2", "a.gltf");
    const fs::path buffer = folder_ / "a.bin";
    ASSERT_TRUE(fs::exists(buffer));
    fs::resize_file(buffer, fs::file_size(buffer) / 2);
    expect_refused(path, ErrorCode::bad_file, "");
    fs::remove(buffer);
    expect_refused(path, ErrorCode::bad_file, "");
}

// ---- polygons ----

// A comb of four teeth, extruded: two concave caps of 16 corners, and sides of 4.
struct Comb {
    std::vector<std::array<double, 3>> vertices;
    std::vector<std::vector<uint32_t>> faces;
    double volume = 0;
};
Comb comb(double angle) {
    std::vector<std::array<double, 2>> p = {{0, 0}, {7, 0}};
    for (int t = 3; t >= 0; --t) {
        const double h = 1 + 0.5 * ((3 * t) % 4);
        p.push_back({2. * t + 1, h}), p.push_back({2. * t, h});
        if (t > 0) p.push_back({2. * t, 0.25}), p.push_back({2. * t - 1, 0.25});
    }
    Comb out;
    const auto n = static_cast<uint32_t>(p.size());
    for (uint32_t i = 0; i < n; ++i) {
        const auto &a = p[i], &b = p[(i + 1) % n];
        out.volume += (a[0] * b[1] - a[1] * b[0]) / 2;
    }
    for (const double z : {0., 1.})
        for (const auto& [x, y] : p)
            out.vertices.push_back(
                {x * std::cos(angle) - z * std::sin(angle), y, x * std::sin(angle) + z * std::cos(angle)});
    out.faces.resize(2);
    for (uint32_t i = 0; i < n; ++i) {
        out.faces[0].push_back(n - 1 - i), out.faces[1].push_back(n + i);
        out.faces.push_back({i, (i + 1) % n, n + (i + 1) % n, n + i});
    }
    return out;
}
std::string joined(const auto& numbers, double add = 0) {
    std::string out;
    char word[40];
    for (const auto x : numbers) std::snprintf(word, sizeof word, "%.17g ", static_cast<double>(x) + add), out += word;
    return out;
}

TEST_F(Import, ConcavePolygonsAreWholeInEveryFormatThatHasThem) {
    for (const double angle : {0., 0.3, 1.1}) {
        const Comb c = comb(angle);
        std::string obj, off, ply, dae_points, dae_corners, dae_sizes, binary;
        for (const auto& v : c.vertices) {
            obj += "v " + joined(v) + "\n", off += joined(v) + "\n", dae_points += joined(v);
            binary.append(reinterpret_cast<const char*>(v.data()), sizeof v);
        }
        ply = off;
        for (const auto& f : c.faces) {
            const std::string size = std::to_string(f.size()) + " ";
            obj += "f " + joined(f, 1) + "\n", off += size + joined(f) + "\n", ply += size + joined(f) + "\n";
            dae_corners += joined(f), dae_sizes += size;
            binary += static_cast<char>(f.size());
            binary.append(reinterpret_cast<const char*>(f.data()), f.size() * sizeof f[0]);
        }
        const std::string vertices = std::to_string(c.vertices.size()), faces = std::to_string(c.faces.size());
        const auto header = [&](const std::string& format) {
            return "ply\nformat " + format + " 1.0\nelement vertex " + vertices +
                   "\nproperty double x\nproperty double y\nproperty double z\nelement face " + faces +
                   "\nproperty list uchar int vertex_indices\nend_header\n";
        };
        const std::string collada =
            R"(<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset/>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="a" count=")" +
            std::to_string(3 * c.vertices.size()) + "\">" + dae_points +
            R"(</float_array><technique_common><accessor source="#a" count=")" + vertices +
            R"(" stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
</accessor></technique_common></source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<polylist count=")" +
            faces + R"("><input semantic="VERTEX" source="#v" offset="0"/><vcount>)" + dae_sizes + "</vcount><p>" +
            dae_corners + R"(</p></polylist></mesh></geometry></library_geometries><library_visual_scenes>
<visual_scene id="s"><node id="n"><instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>)";
        for (const std::string& path :
             {write("c.obj", obj), write("c.off", "OFF\n" + vertices + " " + faces + " 0\n" + off),
              write("t.ply", header("ascii") + ply), write("b.ply", header("binary_little_endian") + binary),
              write("c.dae", collada)}) {
            const Mesh mesh = load(path);
            const auto cleaned = clean(mesh.view());
            ASSERT_TRUE(cleaned) << path;
            EXPECT_TRUE(cleaned->report.closed) << path;
            EXPECT_EQ(mesh.triangles.size(), 2 * 14 + 2 * 16u) << path;
            EXPECT_NEAR(signed_volume(mesh), c.volume, 1e-5 * c.volume) << path;
        }
    }
}

TEST_F(Import, APolygonThatCrossesItselfIsNamed) {
    expect_refused(write("a.obj", "v 0 0 0\nv 1 1 0\nv 1 0 0\nv 0 1 0\nf 1 3 2 4\nf 1 2 3 4\n"), ErrorCode::bad_file,
                   "line 6");
    expect_refused(write("a.off", "OFF\n4 1 0\n0 0 0\n1 1 0\n1 0 0\n0 1 0\n4 0 1 2 3\n"), ErrorCode::bad_file,
                   "line 7");
}

TEST_F(Import, SaysHowFarPolygonsAreFromFlat) {
    ImportReport report;
    const std::string quads = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0.25\nf 1 2 3 4\nf 2 5 6 3\n";
    EXPECT_EQ(load(write("bent.obj", quads), {}, report).triangles.size(), 4u);
    ASSERT_EQ(report.notes.size(), 1u);
    EXPECT_TRUE(report.notes[0].starts_with("1 of 2 polygons are not flat")) << report.notes[0];
}

TEST_F(Import, ReadsTriangleStripsOfPly) {
    const std::string header =
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
        "property float z\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n";
    expect_tetrahedron(write("strips.ply", header + "0 0 0\n1.5 0 0\n0 1.25 0\n0 0 1\n"
                                                    "15 0 2 1 -1 0 1 3 -1 1 2 3 -1 2 0 3\n"));
    const Mesh strip = load(write("strip.ply", header + "0 0 0\n1 0 0\n0 1 0\n1 1 0\n4 0 1 2 3\n"));
    ASSERT_EQ(strip.triangles.size(), 2u);
    EXPECT_EQ(strip.triangles[0], (Triangle{0, 1, 2}));
    EXPECT_EQ(strip.triangles[1], (Triangle{1, 3, 2}));
}

TEST_F(Import, ObjIsWholeOrRefused) {
    const std::string vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    expect_refused(write("surface.obj", vertices + "f 1 2 3\nsurf 0 1 0 1 1 2 3\n"), ErrorCode::bad_file, "line 5");
    expect_tetrahedron(write("mark.obj", std::string("\xEF\xBB\xBF") + kObj));
    expect_tetrahedron(write("colours.obj", "v 0 0 0 1 0 0\nv 1.5 0 0 1 0 0\nv 0 1.25 0 0 1 0\nv 0 0 1 0 1 1\n"
                                            "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"));
    ImportReport report;
    const Mesh weighted = load(write("w.obj", "v 0 0 0 1\nv 2 0 0 2\nv 0 1 0\nf 1 2 3\nl 1 2\n"), {}, report);
    EXPECT_EQ(weighted.vertices[1], (Vec3{1, 0, 0}));
    ASSERT_EQ(report.notes.size(), 2u) << "the line, the weight";
    for (const char* mark : {"\xFF\xFE", "\xFE\xFF"})
        expect_refused(write("wide.obj", std::string(mark) + std::string("v\0 \0", 4)), ErrorCode::bad_file, "UTF-16");
    expect_refused(write("far.obj", "v 0 0 0\nv 1e39 0 0\nv 0 1 0\nf 1 2 3\n"), ErrorCode::bad_file, "line 4");
}

// ---- glTF ----

std::string base64(std::string_view bytes) {
    static constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string out;
    for (size_t i = 0; i < bytes.size(); i += 3) {
        uint32_t three = 0;
        for (size_t k = 0; k < 3; ++k)
            three = three << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
        for (size_t k = 0; k < 4; ++k) out += i + k > bytes.size() ? '=' : kDigits[three >> (18 - 6 * k) & 63];
    }
    return out;
}

// Writes a glTF file piece by piece.
class Gltf {
public:
    template <class T> size_t view(const std::vector<T>& numbers, size_t stride = 0) {
        while (data_.size() % 4) data_ += '\0';
        const size_t at = data_.size();
        data_.append(reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(T));
        add(views_, R"({"buffer":0,"byteOffset":)" + std::to_string(at) + R"(,"byteLength":)" +
                        std::to_string(data_.size() - at) +
                        (stride ? R"(,"byteStride":)" + std::to_string(stride) : "") + "}");
        return view_count_++;
    }
    size_t accessor(size_t view, int component, size_t count, const std::string& type, const std::string& more = "") {
        return raw_accessor(R"("bufferView":)" + std::to_string(view) + "," + words(component, count, type) + more);
    }
    static std::string words(int component, size_t count, const std::string& type) {
        return R"("componentType":)" + std::to_string(component) + R"(,"count":)" + std::to_string(count) +
               R"(,"type":")" + type + '"';
    }
    size_t raw_accessor(const std::string& members) {
        add(accessors_, "{" + members + "}");
        return accessor_count_++;
    }
    std::string file(const std::string& primitives, const std::string& nodes, const std::string& more) const {
        return R"({"asset":{"version":"2.0"},"meshes":[{"primitives":[)" + primitives + R"(]}],"nodes":)" + nodes +
               R"(,"accessors":[)" + accessors_ + R"(],"bufferViews":[)" + views_ + R"(],"buffers":[{"byteLength":)" +
               std::to_string(data_.size()) + R"(,"uri":"data:application/octet-stream;base64,)" + base64(data_) +
               "\"}]" + more + "}";
    }

private:
    static void add(std::string& list, const std::string& one) { list += (list.empty() ? "" : ",") + one; }
    std::string data_, views_, accessors_;
    size_t view_count_ = 0, accessor_count_ = 0;
};
constexpr const char* kScene = R"(,"scene":0,"scenes":[{"nodes":[0]}])";
const std::vector<uint16_t> kTetrahedron = {0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3};

// (0 0 0), (1.5 0 0), (0 1.25 0), (0 0 1) as whole numbers of `one`, under a scale that takes them back.
template <class T> std::string quantised(double one, int component, bool normalised) {
    const auto q = static_cast<T>(one);
    Gltf g;
    // Rows are padded to multiples of four bytes.
    std::vector<T> rows(4 * 4, 0);
    rows[4] = rows[9] = rows[14] = q;
    const size_t points =
        g.accessor(g.view(rows, 4 * sizeof(T)), component, 4, "VEC3", normalised ? R"(,"normalized":true)" : "");
    const size_t corners = g.accessor(g.view(kTetrahedron), 5123, 12, "SCALAR");
    const double unit = normalised ? one / (static_cast<double>(std::numeric_limits<T>::max())) : one;
    char scale[100];
    std::snprintf(scale, sizeof scale, R"([{"mesh":0,"scale":[%.17g,%.17g,%.17g]}])", 1.5 / unit, 1.25 / unit,
                  1 / unit);
    return g.file(R"({"attributes":{"POSITION":)" + std::to_string(points) + R"(},"indices":)" +
                      std::to_string(corners) + "}",
                  scale,
                  std::string(kScene) +
                      R"(,"extensionsUsed":["KHR_mesh_quantization"],"extensionsRequired":["KHR_mesh_quantization"])");
}

TEST_F(Import, QuantisedGltf) {
    for (const bool normalised : {false, true}) {
        expect_tetrahedron(write("b.gltf", quantised<int8_t>(100, 5120, normalised)));
        expect_tetrahedron(write("ub.gltf", quantised<uint8_t>(200, 5121, normalised)));
        expect_tetrahedron(write("s.gltf", quantised<int16_t>(30000, 5122, normalised)));
        expect_tetrahedron(write("us.gltf", quantised<uint16_t>(60000, 5123, normalised)));
    }
}

TEST_F(Import, InstancesSparseStripsAndFansOfGltf) {
    const std::vector<float> points = {0, 0, 0, 1.5f, 0, 0, 0, 1.25f, 0, 0, 0, 1};
    const auto primitive = [](size_t position, const std::string& more) {
        return R"({"attributes":{"POSITION":)" + std::to_string(position) + "}" + more + "}";
    };
    { // three instances under a node that mirrors: one moved, one turned upside down, one doubled
        Gltf g;
        const size_t p = g.accessor(g.view(points), 5126, 4, "VEC3"),
                     c = g.accessor(g.view(kTetrahedron), 5123, 12, "SCALAR");
        const size_t t = g.accessor(g.view(std::vector<float>{0, 0, 0, 10, 0, 0, 0, 10, 0}), 5126, 3, "VEC3");
        const size_t r = g.accessor(g.view(std::vector<int16_t>{0, 0, 0, 32767, 32767, 0, 0, 0, 0, 0, 0, 32767}), 5122,
                                    3, "VEC4", R"(,"normalized":true)");
        const size_t s = g.accessor(g.view(std::vector<float>{1, 1, 1, 1, 1, 1, 2, 2, 2}), 5126, 3, "VEC3");
        const std::string nodes =
            R"([{"mesh":0,"scale":[-1,1,1],"extensions":{"EXT_mesh_gpu_instancing":{"attributes":{"TRANSLATION":)" +
            std::to_string(t) + R"(,"ROTATION":)" + std::to_string(r) + R"(,"SCALE":)" + std::to_string(s) + "}}}}]";
        const Mesh mesh =
            load(write("i.gltf", g.file(primitive(p, R"(,"indices":)" + std::to_string(c)), nodes,
                                        std::string(kScene) + R"(,"extensionsRequired":["EXT_mesh_gpu_instancing"])")));
        EXPECT_EQ(mesh.triangles.size(), 12u);
        EXPECT_NEAR(signed_volume(mesh), (1 + 1 + 8) * kVolume, 1e-4) << "turned by the mirroring node";
        float left = 0, top = 0, bottom = 0;
        for (const Vec3& v : mesh.vertices)
            left = std::min(left, v.x), top = std::max(top, v.y), bottom = std::min(bottom, v.y);
        EXPECT_NEAR(left, -11.5f, 1e-5);
        EXPECT_NEAR(top, 12.5f, 1e-5);
        EXPECT_NEAR(bottom, -1.25f, 1e-4);
    }
    { // positions that a sparse accessor puts right, over a view, and over nothing
        for (const bool over_view : {false, true}) {
            Gltf g;
            std::vector<float> wrong = points;
            wrong[3] = 99, wrong[11] = -5;
            if (!over_view) wrong.assign(12, 0);
            const size_t base = g.view(wrong);
            const size_t at = g.view(std::vector<uint8_t>{1, 2, 3}),
                         to = g.view(std::vector<float>(points.begin() + 3, points.end()));
            const std::string sparse = R"(,"sparse":{"count":3,"indices":{"bufferView":)" + std::to_string(at) +
                                       R"(,"componentType":5121},"values":{"bufferView":)" + std::to_string(to) + "}}";
            const size_t p = over_view ? g.accessor(base, 5126, 4, "VEC3", sparse)
                                       : g.raw_accessor(Gltf::words(5126, 4, "VEC3") + sparse);
            const size_t c = g.accessor(g.view(kTetrahedron), 5123, 12, "SCALAR");
            expect_tetrahedron(
                write("s.gltf", g.file(primitive(p, R"(,"indices":)" + std::to_string(c)), R"([{"mesh":0}])", "")));
        }
    }
    { // a strip, and a fan; nodes that the scene does not name stay away
        Gltf g;
        const size_t p = g.accessor(g.view(points), 5126, 4, "VEC3");
        const size_t strip = g.accessor(g.view(std::vector<uint8_t>{0, 2, 1, 3}), 5121, 4, "SCALAR");
        const size_t fan = g.accessor(g.view(std::vector<uint32_t>{3, 2, 0, 1}), 5125, 4, "SCALAR");
        const std::string both = primitive(p, R"(,"mode":5,"indices":)" + std::to_string(strip)) + "," +
                                 primitive(p, R"(,"mode":6,"indices":)" + std::to_string(fan)) + "," +
                                 primitive(p, R"(,"mode":1)");
        const std::string path =
            write("f.gltf", g.file(both, R"([{"mesh":0},{"mesh":0,"translation":[50,0,0]}])", kScene));
        expect_tetrahedron(path);
        ImportReport report;
        load(path, {}, report);
        EXPECT_EQ(report.notes.size(), 2u) << "y is up; lines are left out";
    }
}

// A tetrahedron of two joints and two morph targets. Its node's transform does not count, as glTF says.
std::string rigged_tetrahedron(const std::vector<float>& weights, const std::string& more_nodes = "",
                               const std::string& scene = "0") {
    Gltf g;
    const std::vector<float> points = {0, 0, 0, 1.5f, 0, 0, 0, 1.25f, 0, 0, 0, 1};
    const size_t p = g.accessor(g.view(points), 5126, 4, "VEC3"),
                 c = g.accessor(g.view(kTetrahedron), 5123, 12, "SCALAR");
    const size_t j = g.accessor(g.view(std::vector<uint8_t>{0, 9, 9, 9, 1, 0, 9, 9, 0, 1, 9, 9, 1, 9, 9, 9}), 5121, 4,
                                "VEC4"),
                 w = g.accessor(g.view(weights), 5126, 4, "VEC4");
    const size_t up = g.accessor(g.view(std::vector<float>{0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0.5f}), 5126, 4, "VEC3"),
                 in = g.accessor(g.view(std::vector<float>{0, 0, 0, -1, 0, 0, 0, 0, 0, 0, 0, 0}), 5126, 4, "VEC3");
    // The second joint is turned, and its origin is at (-0.25, 0.5, 1).
    const std::vector<float> bind = {1, 0, 0, 0, 0,  1, 0, 0, 0, 0, 1, 0, 0,    0,     0,  1,
                                     0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 0.5f, 0.25f, -1, 1};
    const size_t m = g.accessor(g.view(bind), 5126, 2, "MAT4");
    const auto n = [](size_t x) { return std::to_string(x); };
    return g.file(
        R"({"attributes":{"POSITION":)" + n(p) + R"(,"JOINTS_0":)" + n(j) + R"(,"WEIGHTS_0":)" + n(w) +
            R"(},"indices":)" + n(c) + R"(,"targets":[{"POSITION":)" + n(up) + R"(},{"POSITION":)" + n(in) + R"(}]})",
        R"([{"mesh":0,"skin":0,"weights":[0,-2],"translation":[5,0,0]},{"name":"hip","children":[2]},{"name":"knee"})" +
            more_nodes + "]",
        R"(,"scene":0,"scenes":[{"nodes":[)" + scene + R"(]}],"skins":[{"joints":[1,2],"inverseBindMatrices":)" + n(m) +
            "}]");
}

TEST_F(Import, SkinsAndMorphTargetsOfGltf) {
    const std::vector<float> weights = {1, 0, 0, 0, 0.75f, 0.25f, 0, 0, 0.5f, 0.5f, 0, 0, 1, 0, 0, 0};
    const std::string path = write("rig.gltf", rigged_tetrahedron(weights));
    expect_tetrahedron(path);
    const auto rigged = load_rigged_mesh(path.c_str(), {.unit = 2, .scale = {1, 1, -1}});
    ASSERT_TRUE(rigged) << rigged.error().what;
    EXPECT_EQ(rigged->bones, (std::vector<std::string>{"hip", "knee"}));
    EXPECT_EQ(rigged->parents, (std::vector<uint32_t>{0, 0}));
    EXPECT_EQ(rigged->joints, (std::vector<Vec3>{{0, 0, 0}, {-0.5f, 1, -2}}));
    EXPECT_EQ(rigged->weights_each, 4u);
    EXPECT_EQ(rigged->weights, weights);
    EXPECT_EQ(rigged->indices, (std::vector<uint16_t>{0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0}));
    EXPECT_EQ(rigged->modes.size(), 2u);
    EXPECT_EQ(rigged->ranges, (std::vector<float>{1, 2}));
    std::vector<float> moved(24);
    moved[11] = -1, moved[15] = -2; // as the mesh is scaled
    EXPECT_EQ(rigged->displacements, moved);
    const auto mesh = load_mesh(path.c_str(), {.unit = 2, .scale = {1, 1, -1}});
    EXPECT_EQ(rigged->mesh.vertices, mesh->vertices);
    EXPECT_EQ(rigged->mesh.triangles, mesh->triangles);

    const auto refused = [this](const std::string& text, const char* words, const char* name = "bad.gltf") {
        ImportReport report;
        const auto bad = load_rigged_mesh(write(name, text).c_str(), {}, &report);
        ASSERT_FALSE(bad) << words;
        EXPECT_NE((bad.error().what + (" " + report.detail)).find(words), std::string::npos)
            << bad.error().what << " / " << report.detail;
    };
    const std::string good = rigged_tetrahedron(weights);
    const auto with = [&good](const std::string& old, const std::string& text) {
        std::string out = good;
        return out.replace(out.find(old), old.size(), text);
    };
    refused(kOff, "only glTF", "a.off");
    refused(with(R"("joints":[1,2])", R"("joints":[1])"), "a joint that the skin does not have");
    refused(with(R"("joints":[1,2])", R"("joints":[])"), "without joints");
    refused(with(R"("joints":[1,2])", R"("joints":[1,2,2])"), "fewer matrices than joints");
    refused(with(R"("joints":[1,2])", R"("joints":[1,7])"), "does not exist skins[0].joints[1]");
    refused(with(R"(,"JOINTS_0")", R"(,"OTHERS_0")"), "without joints");
    refused(with(R"(,"skin":0,"weights":[0,-2])", R"(,"skin":0,"weights":[0])"), "wrong length nodes[0].weights");
    refused(rigged_tetrahedron(weights, R"(,{"mesh":0})", "0,3"), "beside skinned ones");
    std::vector<float> heavy = weights;
    heavy[9] = 0.75f;
    refused(rigged_tetrahedron(heavy), "do not add up to 1; normalise them");
    refused(rigged_tetrahedron(heavy), "WEIGHTS_0, row 2");
    refused(quantised<int8_t>(100, 5120, false), "neither skins nor morph targets");
}

TEST_F(Import, GltfExtensionsThatAreNotReadAreNamed) {
    Gltf g;
    const size_t p = g.accessor(g.view(std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0}), 5126, 3, "VEC3");
    const std::string primitive = R"({"attributes":{"POSITION":)" + std::to_string(p) + "}}";
    const auto with = [&](const std::string& name) {
        return write("x.gltf", g.file(primitive, R"([{"mesh":0}])", R"(,"extensionsRequired":[")" + name + "\"]"));
    };
    for (const char* name : {"KHR_draco_mesh_compression", "EXT_meshopt_compression", "ACME_new_geometry"})
        expect_refused(with(name), ErrorCode::bad_file, name);
    EXPECT_EQ(load(with("KHR_materials_unlit")).triangles.size(), 1u);
    EXPECT_EQ(load(with("KHR_texture_basisu")).triangles.size(), 1u);
    // Compressed without being required, and with nothing to fall back on.
    Gltf h;
    h.view(std::vector<float>{0, 0, 0});
    h.raw_accessor(Gltf::words(5126, 3, "VEC3"));
    expect_refused(write("y.gltf", h.file(R"({"attributes":{"POSITION":0}})", R"([{"mesh":0}])", "")),
                   ErrorCode::bad_file, "without data");
    expect_refused(write("z.gltf", g.file(R"({"attributes":{"POSITION":7}})", R"([{"mesh":0}])", "")),
                   ErrorCode::bad_file, "meshes[0].primitives[0].attributes.POSITION");
    expect_refused(write("loop.gltf", g.file(primitive, R"([{"mesh":0,"children":[1]},{"children":[0]}])", kScene)),
                   ErrorCode::bad_file, "node");
}

// A member of a wrong type or range is never taken for absent, cut short, or for 0.
TEST_F(Import, GltfOfWrongTypesAndRangesIsRefusedByPlace) {
    Gltf g;
    const size_t p = g.accessor(g.view(std::vector<float>{0, 0, 0, 1.5f, 0, 0, 0, 1.25f, 0, 0, 0, 1}, 12), 5126, 4,
                                "VEC3", R"(,"byteOffset":0,"normalized":false)");
    const size_t c = g.accessor(g.view(kTetrahedron), 5123, 12, "SCALAR");
    const std::string good = g.file(R"({"attributes":{"POSITION":)" + std::to_string(p) + R"(},"mode":4,"indices":)" +
                                        std::to_string(c) + "}",
                                    R"([{"mesh":0,"translation":[0,0,0],"children":[1]},{}])", kScene);
    expect_tetrahedron(write("good.gltf", good));
    expect_tetrahedron(write("float.gltf", with(good, R"("count":4)", R"("count":4.0)")));
    const std::pair<const char*, std::pair<const char*, const char*>> kOffences[] = {
        {R"("bufferView":0)", {R"("bufferView":true)", "accessors[0].bufferView"}},
        {R"("bufferView":0)", {R"("bufferView":4294967296)", "does not exist accessors[0].bufferView"}},
        {R"("bufferView":0)", {R"("bufferView":-1)", "accessors[0].bufferView"}},
        {R"("count":4)", {R"("count":1e39)", "accessors[0].count"}},
        {R"("count":4)", {R"("count":-4)", "accessors[0].count"}},
        {R"("count":4)", {R"("count":"4")", "accessors[0].count"}},
        {R"("count":4)", {R"("count":4.5)", "accessors[0].count"}},
        {R"("count":4)", {R"("count":9007199254740992)", "reaches beyond its buffer view accessors[0]"}},
        {R"("count":4)", {R"("count":5)", "reaches beyond its buffer view accessors[0]"}},
        {R"("count":4,)", {"", "missing accessors[0].count"}},
        {R"("byteOffset":0,"normalized")", {R"("byteOffset":1e39,"normalized")", "accessors[0].byteOffset"}},
        {R"("byteOffset":0,"normalized")", {R"("byteOffset":1,"normalized")", "reaches beyond"}},
        {R"("normalized":false)", {R"("normalized":0)", "accessors[0].normalized"}},
        {R"("componentType":5126)", {R"("componentType":5124)", "unknown type of numbers accessors[0]"}},
        {R"("componentType":5123)", {R"("componentType":5126)", "accessors[1]"}},
        {R"("type":"VEC3")", {R"("type":"VEC4")", "accessors[0].type"}},
        {R"("byteStride":12)", {R"("byteStride":4)", "bufferViews[0].byteStride"}},
        {R"("byteLength":48)", {R"("byteLength":47)", "reaches beyond"}},
        {R"("byteLength":48)", {R"("byteLength":4800)", "bufferViews[0]"}},
        {R"("buffer":0)", {R"("buffer":1)", "bufferViews[0].buffer"}},
        {R"("buffers":[{"byteLength":72)", {R"("buffers":[{"byteLength":73)", "buffers[0]"}},
        {R"(;base64,)", {R"(;base64,!)", "not base64 buffers[0].uri"}},
        {R"(data:application/octet-stream;base64,)", {R"(https://example.com/)", "in the net"}},
        {R"("mode":4)", {R"("mode":7)", "primitives[0].mode"}},
        {R"("mode":4)", {R"("mode":null)", "primitives[0].mode"}},
        {R"("indices":1)", {R"("indices":-1)", "primitives[0].indices"}},
        {R"("mesh":0)", {R"("mesh":0.5)", "nodes[0].mesh"}},
        {R"("mesh":0)", {R"("mesh":[0])", "nodes[0].mesh"}},
        {R"([0,0,0])", {R"([0,0])", "nodes[0].translation"}},
        {R"([0,0,0])", {R"([0,"0",0])", "nodes[0].translation[1]"}},
        {R"("translation":[0,0,0])", {R"("matrix":[1,0,0,1,0,1,0,0,0,0,1,0,0,0,0,1])", "perspective"}},
        {R"("children":[1])", {R"("children":[2])", "nodes[0].children[0]"}},
        {R"("children":[1])", {R"("children":[0])", "two parents nodes[0]"}},
        {R"("children":[1])", {R"("children":{})", "not a list nodes[0].children"}},
        {R"("scene":0)", {R"("scene":1)", "does not exist scene"}},
        {R"("version":"2.0")", {R"("version":"1.0")", "asset.version"}},
        {R"("version":"2.0")", {R"("version":2)", "asset.version"}},
    };
    for (const auto& [old, change] : kOffences)
        expect_refused(write("bad.gltf", with(good, old, change.first)), ErrorCode::bad_file, change.second);

    const auto sparse = [&](const std::string& count) {
        Gltf h;
        h.view(std::vector<uint8_t>{0}), h.view(std::vector<float>{0, 0, 0});
        h.raw_accessor(R"("componentType":5126,"count":)" + count +
                       R"(,"type":"VEC3","sparse":{"count":1,"indices":{"bufferView":0,"componentType":5121},)"
                       R"("values":{"bufferView":1}})");
        return write("s.gltf", h.file(R"({"attributes":{"POSITION":0}})", R"([{"mesh":0}])", ""));
    };
    expect_refused(sparse("3"), ErrorCode::bad_mesh, "no triangle with an area"); // read, and all zeros
    expect_refused(sparse("9007199254740992"), ErrorCode::bad_file, "accessors[0].count");
    expect_refused(sparse("0"), ErrorCode::bad_file, "beyond the accessor's count");
}

TEST_F(Import, GltfBuffersInOtherFiles) {
    Gltf g;
    g.accessor(g.view(std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0}), 5126, 3, "VEC3");
    std::string text = g.file(R"({"attributes":{"POSITION":0}})", R"([{"mesh":0}])", "");
    const size_t uri = text.find("data:");
    text.replace(uri, text.find('"', uri) - uri, "its%20numbers.bin");
    const std::string path = write("a.gltf", text);
    expect_refused(path, ErrorCode::bad_file, "its%20numbers.bin");
    const float numbers[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    const std::string beside = write("its numbers.bin", {reinterpret_cast<const char*>(numbers), sizeof numbers});
    ImportReport report;
    EXPECT_EQ(load(path, {}, report).triangles.size(), 1u);
    EXPECT_EQ(report.files, std::vector<std::string>{beside});
    fs::remove(beside);
    ASSERT_EQ(::mkfifo(beside.c_str(), 0600), 0);
    expect_refused(path, ErrorCode::bad_file, "its%20numbers.bin"); // and does not wait for a writer
}

// ---- 3DS ----

template <class... T> std::string raw(T... values) {
    std::string out;
    (out.append(reinterpret_cast<const char*>(&values), sizeof values), ...);
    return out;
}
std::string chunk(uint16_t id, const std::string& content) {
    return raw(id, static_cast<uint32_t>(6 + content.size())) + content;
}
// The tetrahedron as an object.
std::string object(const std::string& name, const std::string& frame = "") {
    const std::string points = raw(uint16_t{4}, 0.f, 0.f, 0.f, 1.5f, 0.f, 0.f, 0.f, 1.25f, 0.f, 0.f, 0.f, 1.f);
    std::string faces = raw(uint16_t{4});
    for (size_t i = 0; i < 12; i += 3)
        faces += raw(kTetrahedron[i], kTetrahedron[i + 1], kTetrahedron[i + 2], uint16_t{7});
    return chunk(0x4000, name + '\0' + chunk(0x4100, chunk(0x4110, points) + chunk(0x4120, faces) + frame));
}
std::string frame(std::array<float, 12> columns) {
    return chunk(0x4160, {reinterpret_cast<const char*>(columns.data()), sizeof columns});
}
template <class... T> std::string key_track(uint16_t id, T... first) {
    const auto key = [](uint32_t at, auto... values) { return raw(at, uint16_t{0}, values...); };
    return chunk(id, raw(uint16_t{0}, uint64_t{0}, uint32_t{2}) + key(7, (first + 50)...) + key(0, first...));
}
std::string node(const std::string& name, uint16_t id, uint16_t parent, const std::string& tracks) {
    return chunk(0xb002, chunk(0xb030, raw(id)) + chunk(0xb010, name + '\0' + raw(0u, parent)) + tracks);
}
std::string three_ds(const std::string& objects, const std::string& nodes = "") {
    return chunk(0x4d4d, chunk(0x3d3d, objects) + (nodes.empty() ? "" : chunk(0xb000, nodes)));
}

TEST_F(Import, ThreeDsPlacesMeshesByTheirNodes) {
    expect_tetrahedron(write("plain.3ds", three_ds(object("a"))));
    // The frame's inverse and the node undo each other; the earliest key counts.
    const std::string shifted =
        frame({0, 1, 0, -1, 0, 0, 0, 0, 1, 5, 6, 7}); // turned by 90 degrees around z, and moved
    const std::string back = key_track(0xb020, 5.f, 6.f, 7.f) + key_track(0xb021, -1.5707964f, 0.f, 0.f, 1.f);
    const auto volume_and_box = [&](const std::string& bytes) {
        const Mesh mesh = load(write("n.3ds", bytes));
        std::array<double, 7> out = {signed_volume(mesh), 99, 99, 99, -99, -99, -99};
        for (const Vec3& v : mesh.vertices) {
            const float p[] = {v.x, v.y, v.z};
            for (size_t k = 0; k < 3; ++k)
                out[1 + k] = std::min<double>(out[1 + k], p[k]), out[4 + k] = std::max<double>(out[4 + k], p[k]);
        }
        return out;
    };
    const auto expect = [&](const std::string& bytes, const std::array<double, 7>& expected) {
        const auto found = volume_and_box(bytes);
        for (size_t k = 0; k < found.size(); ++k) EXPECT_NEAR(found[k], expected[k], 1e-5) << k;
    };
    expect(three_ds(object("a", shifted), node("a", 0, 0xffff, back)), {kVolume, 0, 0, 0, 1.5, 1.25, 1});
    // Twice, the second time below the first, doubled, with its pivot at (0, 0, 1); and a mesh that has no node.
    const std::string place = key_track(0xb020, 10.f, 0.f, 0.f),
                      twice = chunk(0xb013, raw(0.f, 0.f, 1.f)) + key_track(0xb022, 2.f, 2.f, 2.f);
    expect(three_ds(object("a"), node("a", 3, 0xffff, place) + node("a", 4, 3, place + twice)),
           {9 * kVolume, 10, 0, -2, 23, 2.5, 1});
    expect(three_ds(object("a") + object("b"), node("a", 0, 0xffff, place)), {2 * kVolume, 0, 0, 0, 11.5, 1.25, 1});
    // A node that mirrors turns faces; a frame that mirrors turns x.
    expect(three_ds(object("a"), node("a", 0, 0xffff, key_track(0xb022, 1.f, 1.f, -1.f))),
           {kVolume, 0, 0, -1, 1.5, 1.25, 0});
    expect(three_ds(object("a", frame({1, 0, 0, 0, 1, 0, 0, 0, -1, 0, 0, 0})), node("a", 0, 0xffff, "")),
           {kVolume, -1.5, 0, -1, 0, 1.25, 0});
}

TEST_F(Import, HostileThreeDsIsRefused) {
    const auto refuse = [&](const std::string& bytes, const std::string& words) {
        expect_refused(write("h.3ds", bytes), ErrorCode::bad_file, words);
    };
    const std::string good = three_ds(object("a"));
    refuse("no 3DS", "not a 3DS file");
    refuse(with(good, raw(uint16_t{0x4110}, 56u), raw(uint16_t{0x4110}, 57u)), "byte");
    refuse(with(good, raw(uint16_t{0x4110}, 56u), raw(uint16_t{0x4110}, 0u)), "shorter than its header");
    refuse(with(good, raw(uint16_t{0x4110}, 56u), raw(uint16_t{0x4110}, 0xffffffffu)), "ends too early");
    refuse(with(good, raw(uint16_t{0x4110}, 56u, uint16_t{4}), raw(uint16_t{0x4110}, 56u, uint16_t{5})), "too early");
    refuse(with(good, raw(uint16_t{0x4110}, 56u, uint16_t{4}), raw(uint16_t{0x4110}, 56u, uint16_t{3})),
           "does not exist");
    refuse(three_ds(object("a", frame({0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0})), node("a", 0, 0xffff, "")), "flat");
    refuse(three_ds(object("a"), node("a", 0, 1, "") + node("b", 1, 0, "")), "below itself");
    refuse(three_ds(object("a"), node("a", 0, 9, "")), "not an object");
    refuse(three_ds(object("a"), node("a", 0, 0xffff, "") + node("a", 0, 0xffff, "")), "same number");
    refuse(three_ds(object("a"), node("a", 0, 0xffff, chunk(0xb020, raw(uint16_t{0}, uint64_t{0}, ~0u)))), "too early");
    refuse(three_ds(""), "no triangles");
}

// Every reader of ours passes through checkpoints: of a job that is to stop, the first one ends it.
TEST(Readers, CanBeStopped) {
    std::string obj, lines, corners, facets;
    constexpr int kCount = 200;
    for (int i = 0; i < kCount; ++i) {
        lines += "1 2 3\n", corners += "3 0 1 2\n", obj += "v 1 2 3\n";
        facets += "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
    }
    const std::string ply = "ply\nformat ascii 1.0\nelement vertex 200\nproperty float x\nproperty float y\n"
                            "property float z\nelement face 200\nproperty list uchar int vertex_indices\nend_header\n";
    std::string binary_stl(80, ' ');
    binary_stl += raw(uint32_t{kCount}) + std::string(50 * kCount, '\0');
    Gltf g;
    const size_t p = g.accessor(g.view(std::vector<float>(3 * kCount, 1)), 5126, kCount, "VEC3");
    const std::string gltf = g.file(R"({"attributes":{"POSITION":)" + std::to_string(p) + "}}", R"([{"mesh":0}])", "");
    std::string detail;
    ImportReport report;
    const std::function<void()> readers[] = {
        [&] { static_cast<void>(read_obj(obj, detail)); },
        [&] { static_cast<void>(read_off("OFF\n200 200 0\n" + lines + corners, detail)); },
        [&] { static_cast<void>(read_ply(ply + lines + corners, detail)); },
        [&] { static_cast<void>(read_stl("solid a\n" + facets + "endsolid a\n", detail)); },
        [&] { static_cast<void>(read_stl(binary_stl, detail)); },
        [&] { static_cast<void>(read_3ds(three_ds(object("a")), detail)); },
        [&] { static_cast<void>(read_collada(dae(kDaeNode), detail)); },
        [&] { static_cast<void>(read_gltf(".gltf", gltf, "a.gltf", report)); },
    };
    for (const auto& read : readers) {
        Job job(1, [] { return false; });
        EXPECT_THROW(job.ask(), Cancelled);
        EXPECT_THROW(job.run(read), Cancelled) << &read - readers;
        read(); // outside the job nobody asks
    }
}

TEST_F(Import, IsCancelled) {
    std::string text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    for (int i = 0; i < 19; ++i) text += text; // 18 MB: more than the time between two questions
    const auto mesh = load_mesh(write("long.obj", text).c_str(), {}, nullptr, [] { return false; });
    ASSERT_FALSE(mesh);
    EXPECT_EQ(mesh.error().code, ErrorCode::cancelled);
}

// ---- where it stands ----

TEST_F(Import, ScalesMirrorsAndUnits) {
    const std::string path = write("a.obj", kObj);
    ImportReport report;
    const Mesh scaled = load(path, {.unit = 0.001, .scale = {2, 2, 2}}, report);
    EXPECT_NEAR(signed_volume(scaled), 8e-9 * kVolume, 1e-14);
    EXPECT_EQ(scaled.placement, (Placement{{0.002, 0.002, 0.002}, {}}));
    const Mesh mirrored = load(path, {.scale = {1, -1, 3}}, report);
    EXPECT_NEAR(signed_volume(mirrored), 3 * kVolume, 1e-6) << "its faces are turned";
    EXPECT_EQ(load(path, placed_as(mirrored.placement), report).vertices, mirrored.vertices);
    for (const ImportOptions& bad :
         {ImportOptions{.scale = {1, 0, 1}}, ImportOptions{.scale = {1, NAN, 1}}, ImportOptions{.unit = -1}}) {
        const auto mesh = load_mesh(path.c_str(), bad);
        ASSERT_FALSE(mesh);
        EXPECT_EQ(mesh.error().code, ErrorCode::bad_options);
    }
    const std::string millimetres = write("mm.dae", dae(kDaeNode));
    load(millimetres, {}, report);
    ASSERT_FALSE(report.notes.empty());
    EXPECT_NE(report.notes[0].find("0.0254 m"), std::string::npos) << report.notes[0];
    EXPECT_NE(report.notes[0].find("z up"), std::string::npos) << report.notes[0];
    ASSERT_EQ(report.notes.size(), 2u);
    EXPECT_NE(report.notes[1].find("not applied"), std::string::npos) << report.notes[1];
    load(millimetres, {.unit = 0.0254}, report);
    EXPECT_EQ(report.notes.size(), 1u) << "told, and applied";
    EXPECT_NE(hash_mesh_file(path.c_str()), hash_mesh_file(path.c_str(), {.unit = 0.001}));
}

// The tetrahedron far away, in double precision.
TEST_F(Import, FarMeshesNeedALocalOrigin) {
    const auto far = [](double x, double y) {
        std::string out;
        for (const auto& v : {std::array<double, 3>{0, 0, 0}, {1.5, 0, 0}, {0, 1.25, 0}, {0, 0, 1}})
            out += joined(std::array<double, 3>{v[0] + x, v[1] + y, v[2]}) + "\n";
        return out;
    };
    const std::string faces = "3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n", points = far(500000.125, 5400000.5);
    std::string obj = points;
    for (size_t at = 0; at < obj.size(); at = obj.find('\n', at) + 1) obj.insert(at, "v "), at += 2;
    const std::string header = "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\n"
                               "property double z\nelement face 4\nproperty list uchar int vertex_index\nend_header\n";
    const std::string solid = [&] {
        std::string out = "solid a\n";
        std::vector<std::string> lines;
        for (size_t at = 0; at < points.size();) {
            const size_t end = points.find('\n', at);
            lines.push_back(points.substr(at, end - at)), at = end + 1;
        }
        for (size_t i = 0; i < 12; i += 3) {
            out += "facet normal 0 0 0\nouter loop\n";
            for (size_t k = 0; k < 3; ++k) out += "vertex " + lines[kTetrahedron[i + k]] + "\n";
            out += "endloop\nendfacet\n";
        }
        return out + "endsolid a\n";
    }();
    Gltf g;
    const size_t p = g.accessor(g.view(std::vector<float>{0, 0, 0, 1.5f, 0, 0, 0, 1.25f, 0, 0, 0, 1}), 5126, 4, "VEC3");
    const size_t c = g.accessor(g.view(kTetrahedron), 5123, 12, "SCALAR");
    const std::string collada = with(dae(kDaeNode), "0 0 0 1.5 0 0 0 1.25 0 0 0 1", points);
    for (const std::string& path :
         {write("a.dae", collada), write("a.obj", obj + "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"),
          write("a.off", "OFF\n4 4 0\n" + points + faces), write("a.ply", header + points + faces),
          write("a.stl", solid),
          write("a.gltf", g.file(R"({"attributes":{"POSITION":)" + std::to_string(p) + R"(},"indices":)" +
                                     std::to_string(c) + "}",
                                 R"([{"mesh":0,"translation":[500000.125,5400000.5,0]}])", ""))}) {
        expect_refused(path, ErrorCode::bad_mesh, "--recentre");
        ImportReport report;
        const Mesh mesh = load(path, {.recentre = true}, report);
        ASSERT_EQ(mesh.triangles.size(), 4u) << path;
        EXPECT_NEAR(signed_volume(mesh), kVolume, 1e-5) << path;
        EXPECT_FALSE(report.notes.empty()) << path;
        for (const Vec3& v : mesh.vertices) { // to the file's own numbers
            const double x = v.x + mesh.placement.origin[0] - 500000.125,
                         y = v.y + mesh.placement.origin[1] - 5400000.5;
            EXPECT_TRUE(std::abs(x) < 1e-6 || std::abs(x - 1.5) < 1e-6) << path << ' ' << x;
            EXPECT_TRUE(std::abs(y) < 1e-6 || std::abs(y - 1.25) < 1e-6) << path << ' ' << y;
        }
        EXPECT_EQ(load(path, placed_as(mesh.placement), report).vertices, mesh.vertices);
    }
}

// ---- 3MF ----

// A ZIP archive of stored files.
std::string zip(const std::vector<std::pair<std::string, std::string>>& files) {
    const auto crc = [](std::string_view bytes) {
        uint32_t c = ~0u;
        for (const char byte : bytes) {
            c ^= static_cast<unsigned char>(byte);
            for (int i = 0; i < 8; ++i) c = c & 1 ? c >> 1 ^ 0xedb88320u : c >> 1;
        }
        return ~c;
    };
    const auto put = [](std::string& out, uint32_t value, int bytes) {
        for (int i = 0; i < bytes; ++i) out += static_cast<char>(value >> 8 * i);
    };
    std::string out, index;
    for (const auto& [name, content] : files) {
        const auto at = static_cast<uint32_t>(out.size()), size = static_cast<uint32_t>(content.size());
        std::string common; // version, flags, method, time, date, checksum, sizes, lengths
        put(common, 20, 2), put(common, 0, 2), put(common, 0, 2), put(common, 0, 2), put(common, 33, 2);
        put(common, crc(content), 4), put(common, size, 4), put(common, size, 4);
        put(common, static_cast<uint32_t>(name.size()), 2), put(common, 0, 2);
        out += "PK\3\4" + common + name + content;
        index += "PK\1\2";
        put(index, 20, 2);
        index += common;
        put(index, 0, 2), put(index, 0, 2), put(index, 0, 2), put(index, 0, 4), put(index, at, 4);
        index += name;
    }
    const auto begin = static_cast<uint32_t>(out.size()), count = static_cast<uint32_t>(files.size());
    out += index + "PK\5\6";
    put(out, 0, 2), put(out, 0, 2), put(out, count, 2), put(out, count, 2);
    put(out, static_cast<uint32_t>(index.size()), 4), put(out, begin, 4), put(out, 0, 2);
    return out;
}
std::string three_mf(const std::string& unit, const std::string& resources, const std::string& build) {
    return zip(
        {{"[Content_Types].xml",
          R"(<?xml version="1.0"?><Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types"><Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/><Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>)"},
         {"_rels/.rels",
          R"(<?xml version="1.0"?><Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Target="/3D/3dmodel.model" Id="r" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>)"},
         {"3D/3dmodel.model", R"(<?xml version="1.0"?><model unit=")" + unit +
                                  R"(" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources>)" +
                                  resources + "</resources><build>" + build + "</build></model>"}});
}
constexpr const char* kObject =
    R"(<object id="1" type="model"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1.5" y="0" z="0"/><vertex x="0" y="1.25" z="0"/><vertex x="0" y="0" z="1"/></vertices><triangles><triangle v1="0" v2="2" v3="1"/><triangle v1="0" v2="1" v3="3"/><triangle v1="1" v2="2" v3="3"/><triangle v1="2" v2="0" v3="3"/></triangles></mesh></object>)";

TEST_F(Import, ThreeMfWithUnitsComponentsAndTransforms) {
    expect_tetrahedron(write("a.3mf", three_mf("meter", kObject, R"(<item objectid="1"/>)")));
    ImportReport report;
    const Mesh small = load(write("mm.3mf", three_mf("millimeter", kObject, R"(<item objectid="1"/>)")), {}, report);
    EXPECT_NEAR(signed_volume(small), 1e-9 * kVolume, 1e-15) << "millimetres become metres";
    EXPECT_EQ(small.placement.scale[0], 0.001);
    EXPECT_NE(report.notes.at(0).find("millimetres"), std::string::npos);
    EXPECT_NEAR(
        signed_volume(load(write("in.3mf", three_mf("inch", kObject, R"(<item objectid="1"/>)")), {.unit = 1}, report)),
        kVolume, 1e-6)
        << "unless another unit is told";
    // A component, moved and mirrored; the build doubles and moves what it is in.
    const std::string group =
        std::string(kObject) +
        R"(<object id="2" type="model"><components><component objectid="1" transform="1 0 0 0 1 0 0 0 -1 10 0 0"/><component objectid="1"/></components></object>)";
    const Mesh mesh =
        load(write("g.3mf", three_mf("meter", group, R"(<item objectid="2" transform="2 0 0 0 2 0 0 0 2 0 100 0"/>)")));
    EXPECT_EQ(mesh.triangles.size(), 8u);
    EXPECT_NEAR(signed_volume(mesh), 16 * kVolume, 1e-3);
    float right = 0, low = 0, near = 1000;
    for (const Vec3& v : mesh.vertices)
        right = std::max(right, v.x), low = std::min(low, v.z), near = std::min(near, v.y);
    EXPECT_EQ(right, 23);
    EXPECT_EQ(low, -2);
    EXPECT_EQ(near, 100);
    expect_refused(write("r.3mf", "no archive"), ErrorCode::bad_file, "3MF");
}

// Real files, where installed (Debian package glmark2-data).
void expect_model(const char* path, size_t triangles, uint32_t open_edges) {
    if (!fs::exists(path)) GTEST_SKIP() << path << " is not installed (Debian package glmark2-data)";
    ImportReport report;
    const auto mesh = load_mesh(path, {}, &report);
    ASSERT_TRUE(mesh) << mesh.error().what << ' ' << report.detail;
    EXPECT_EQ(mesh->triangles.size(), triangles);
    const auto cleaned = clean(mesh->view());
    ASSERT_TRUE(cleaned);
    EXPECT_EQ(cleaned->report.open_edges, open_edges);
    EXPECT_EQ(cleaned->report.closed, open_edges == 0);
    EXPECT_GT(signed_volume(cleaned->mesh), 0);
}
// This horse is not closed: 24 of its edges have three triangles, and 2 are run through twice the same way.
TEST(ImportModel, Horse3ds) {
    expect_model("/usr/share/glmark2/models/horse.3ds", 7172, 26);
}
TEST(ImportModel, BunnyObj) {
    expect_model("/usr/share/glmark2/models/bunny.obj", 69666, 0);
}

} // namespace
} // namespace prolate
