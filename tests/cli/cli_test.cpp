// The prolate command as its user meets it: exit codes, one line for each error, nothing half-written.
#include "tests/cli/command.hpp"

#include <prolate/tree.hpp>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <thread>
#include <utility>

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

namespace prolate {
namespace {

using Json = nlohmann::json;

// ---- bake ----

TEST_F(Cli, BakeReportsEachLevel) {
    std::istringstream lines(baked_out_);
    std::string line, heading;
    for (int i = 0; i < 2 && std::getline(lines, line); ++i) heading += line + '\n';
    for (const char* column : {"level", "nodes", "outside ratio", "+/-", "singly", "E_sur", "H max", "mean", "99 %",
                               "% of the diagonal", "covered", "bytes", "seconds"})
        EXPECT_NE(heading.find(column), std::string::npos) << heading;
    int levels = 0;
    for (; std::getline(lines, line); ++levels) {
        EXPECT_NE(line.find("proved"), std::string::npos) << line;
        EXPECT_LE(line.size(), 100u);
    }
    EXPECT_EQ(levels, 3);
    EXPECT_EQ(baked_err_.find('\r'), std::string::npos) << "no progress line where stderr is no terminal";
    // 6 sides of 8 x 8 squares, whose points are shared: 6 * 8 * 8 + 2 points, 2 triangles and 4 corners a square.
    EXPECT_NE(baked_err_.find("768 triangles on 386 distinct vertices (1,536 as read), box "), std::string::npos)
        << baked_err_;

    const Json report = Json::parse(read(shared("report.json")));
    ASSERT_EQ(report["levels"].size(), 3u);
    EXPECT_EQ(report["levels"][0]["nodes"], 1);
    EXPECT_EQ(report["levels"][2]["bytes"], fs::file_size(shared("peanut.etree")));
    EXPECT_TRUE(report["diagnosis"]["closed"]);
    EXPECT_EQ(report["source"], "baked");
    EXPECT_TRUE(report["goal_reached"]);
    Vec3 low{9, 9, 9}, high{-9, -9, -9};
    for (const Vec3& v : peanut(8).vertices) {
        low = {std::min(low.x, v.x), std::min(low.y, v.y), std::min(low.z, v.z)};
        high = {std::max(high.x, v.x), std::max(high.y, v.y), std::max(high.z, v.z)};
    }
    EXPECT_NEAR(report["diagonal"].get<double>(), std::hypot(high.x - low.x, high.y - low.y, high.z - low.z), 1e-5);
    EXPECT_LT(report["solid_volume_error"], 1e-3 * report["solid_volume"].get<double>());
    for (const Json& level : report["levels"]) {
        EXPECT_TRUE(level["covered"]);
        for (const char* figure : {"outside_ratio", "outside_ratio_error", "sum_outside_ratio", "union_volume",
                                   "surface_error", "hausdorff_max", "hausdorff_mean", "hausdorff_p99", "seconds"})
            EXPECT_GT(level[figure], 0) << figure;
        EXPECT_LT(level["outside_ratio_error"], 1e-2);
        EXPECT_GE(level["sum_outside_ratio"], level["outside_ratio"]);
        EXPECT_NEAR(level["percent_of_diagonal"]["surface_error"].get<double>(),
                    100 * level["surface_error"].get<double>() / report["diagonal"].get<double>(), 1e-4);
    }
}

TEST_F(Cli, BakeIsTheSameForAnyNumberOfThreadsAndThroughAPipe) {
    const auto options = [](const std::string& output, const char* threads) {
        return std::vector<std::string>{"bake", shared("peanut.obj"), "-o",   output,      "--levels", "2", "--degree",
                                        "4",    "--quality",          "fast", "--threads", threads};
    };
    const Outcome piped = run(options("-", "1"));
    EXPECT_EQ(piped.code, 0) << piped.err;
    EXPECT_TRUE(piped.out == read(shared("peanut.etree"))) << "the pipe holds the tree and nothing else";
    EXPECT_NE(piped.err.find("outside ratio"), std::string::npos) << "the table went to stderr: " << piped.err;
    const Outcome filed = run(options(file("a.etree"), "2"));
    EXPECT_EQ(filed.code, 0) << filed.err;
    EXPECT_TRUE(read(file("a.etree")) == read(shared("peanut.etree")));
}

TEST_F(Cli, BakePrintsJson) {
    const Outcome o = run({"bake", file("cube.obj", obj_text(cube())), "-o", file("cube.etree"), "--levels", "1",
                           "--quality", "fast", "--json"});
    ASSERT_EQ(o.code, 0) << o.err;
    const Json report = Json::parse(o.out);
    EXPECT_EQ(report["diagnosis"]["input_triangles"], 12);
    EXPECT_NEAR(report["solid_volume"].get<double>(), 8, 0.5);
    EXPECT_EQ(listing(), (std::vector<std::string>{"cube.etree", "cube.obj"}));
}

TEST_F(Cli, MethodAndPrimitiveAreRecorded) {
    const std::string mesh = file("cube.obj", obj_text(cube()));
    for (const auto& [option, value] :
         {std::pair{"method", "voxel"}, {"method", "analytic"}, {"primitive", "sphere"}}) {
        const std::string tree = file(std::string(value) + ".etree");
        const Outcome o = run(
            {"bake", mesh, "-o", tree, "--ellipsoids", "2", "--quality", "fast", std::string("--") + option, value});
        EXPECT_EQ(o.code, 0) << o.err;
        EXPECT_EQ(Json::parse(run({"info", tree, "--json"}).out)[option], value);
        EXPECT_EQ(run({"verify", tree, mesh}).code, 0);
    }
    EXPECT_NE(read(file("voxel.etree")), read(file("analytic.etree")));
}

TEST_F(Cli, AnExactTreeThroughEveryCommand) {
    const std::string mesh = shared("peanut.obj"), tree = file("exact.etree");
    const Outcome baked = run({"bake", mesh, "-o", tree, "--exact", "--report", file("report.json")});
    ASSERT_EQ(baked.code, 0) << baked.err;
    EXPECT_NE(baked.out.find("with 768 triangles"), std::string::npos) << baked.out;
    const Json report = Json::parse(read(file("report.json")));
    EXPECT_EQ(report["exact"], true);
    EXPECT_EQ(report["triangles"], 768);
    EXPECT_EQ(report["bytes"], fs::file_size(tree));

    const Json manifest{{"defaults", {{"levels", 1}}}, // which an exact tree would not take
                        {"assets", {{{"mesh", mesh}, {"output", "other.etree"}, {"exact", true}}}}};
    EXPECT_EQ(run({"bake", "--manifest", file("assets.json", manifest.dump())}).code, 0);
    EXPECT_TRUE(read(file("other.etree")) == read(tree));

    const Json info = Json::parse(run({"info", tree, "--json"}).out);
    EXPECT_EQ(info["exact"], true);
    EXPECT_EQ(info["vertices"], 386);
    EXPECT_EQ(info["components"], 1);
    EXPECT_NE(run({"info", tree}).out.find("768 triangles on 386 vertices, 1 connected component"), std::string::npos);
    const std::string prefix = file("prefix.etree", read(tree).substr(0, info["levels"].back()["end_byte"]));
    EXPECT_EQ(Json::parse(run({"info", prefix, "--json"}).out)["triangles"], 0);
    EXPECT_NE(run({"info", prefix}).out.find("coarser tree"), std::string::npos);

    const Outcome proved = run({"verify", tree, mesh});
    EXPECT_EQ(proved.code, 0) << proved.out;
    EXPECT_NE(proved.out.find("its triangles are the mesh's"), std::string::npos) << proved.out;
    Mesh moved = peanut(8);
    moved.vertices[0].x += 0.01f;
    const Outcome refuted = run({"verify", tree, file("moved.obj", obj_text(moved)), "--json"});
    EXPECT_EQ(refuted.code, 1);
    EXPECT_EQ(Json::parse(refuted.out)["same_triangles"], false);
    EXPECT_EQ(run({"verify", prefix, mesh}).code, 0);

    ASSERT_EQ(run({"export", tree, "-o", file("a.json")}).code, 0);
    uint32_t triangles = 0;
    const Json exported = Json::parse(read(file("a.json")));
    for (const Json& node : exported["nodes"]) triangles += node["triangle_count"].get<uint32_t>();
    EXPECT_EQ(triangles, 768u);
    EXPECT_EQ(run({"export", tree, "-o", file("a.csv")}).code, 0);
    EXPECT_EQ(run({"export", tree, "-o", file("a.ply"), "--level", "1"}).code, 0);
    EXPECT_EQ(run({"render", tree, mesh, "-o", file("a.png"), "--size", "400x300", "--samples", "16"}).code, 0);
    for (const std::vector<std::string>& options :
         std::vector<std::vector<std::string>>{{"--heat"},
                                               {"--heat-top", "3", "--mesh", "none"},
                                               {"--section", "z"},
                                               {"--mesh", "overlay", "--section", "x,0.3"}}) {
        std::vector<std::string> words = {"render", tree,      mesh,        "-o", file("b.png"),
                                          "--size", "400x300", "--samples", "16"};
        words.insert(words.end(), options.begin(), options.end());
        EXPECT_EQ(run(words).code, 0) << options[0];
    }
    EXPECT_EQ(run({"render", tree, mesh, "-o", file("b.png"), "--section", "w"}).code, 2);
    EXPECT_EQ(run({
                      "render",
                      tree,
                      mesh,
                      "-o",
                      file("b.png"),
                      "--section",
                      "z,",
                  })
                  .code,
              2);
    EXPECT_EQ(run({"render", tree, mesh, "-o", file("b.png"), "--heat", "--mesh", "overlay"}).code, 2);
    EXPECT_EQ(run({"render", tree, "-o", file("b.png"), "--heat"}).code, 2);

    const Json hit = Json::parse(run({"collide", tree, tree, "--pose", "0.5,0,0", "--json"}).out);
    EXPECT_EQ(hit["verdict"], "overlapping");
    EXPECT_TRUE(hit["triangle_a"].is_number() && hit["triangle_b"].is_number());
    EXPECT_EQ(hit["enclosed"], false);
    EXPECT_GT(hit["triangle_tests"], 0);
    EXPECT_NE(run({"collide", tree, tree, "--pose", "0.5,0,0"}).out.find("overlapping: triangle "), std::string::npos);
    ASSERT_EQ(run({"bake", file("grain.obj", obj_text(cube(0.01f))), "-o", file("grain.etree"), "--exact"}).code, 0);
    EXPECT_NE(run({"collide", tree, file("grain.etree"), "--pose", "1.5,0.3,0"}).out.find("inside the other"),
              std::string::npos);
}

TEST_F(Cli, ATerminalSeesTheProgress) {
    RunOptions terminal;
    terminal.terminal = true;
    terminal.in_child = [] { ::setenv("TERM", "xterm", 1); };
    const Outcome o =
        run({"bake", shared("peanut.obj"), "-o", file("peanut.etree"), "--levels", "1", "--quality", "fast"}, terminal);
    EXPECT_EQ(o.code, 0);
    EXPECT_NE(o.err.find(" %"), std::string::npos) << o.err;
    const size_t wiped = o.err.rfind("\r\x1b[K");
    ASSERT_NE(wiped, std::string::npos) << o.err;
    EXPECT_TRUE(o.err.substr(wiped + 4).starts_with("prolate: ")) << "the line is gone before the next: " << o.err;
}

TEST_F(Cli, OneTriangleIsALegalOpenMesh) {
    const Outcome o = run({"bake", file("one.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), "-o", file("one.etree"),
                           "--levels", "1", "--quality", "fast"});
    EXPECT_EQ(o.code, 0) << o.err;
    EXPECT_NE(o.err.find("3 open edges: no inside can be promised"), std::string::npos) << o.err;
    EXPECT_EQ(run({"verify", file("one.etree"), file("one.obj")}).code, 0);
    EXPECT_NE(run({"info", file("one.etree")}).out.find("surface mode"), std::string::npos);
}

TEST_F(Cli, BadMeshesAreRefused) {
    const std::string vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    expect_bake_fails(file("missing.obj"), 4, "No such file");
    fs::create_directory(folder_ / "folder.obj");
    expect_bake_fails(file("folder.obj"), 4, "directory");
    expect_bake_fails(file("empty.obj", ""), 3, "empty");
    expect_bake_fails(file("short.obj", vertices + "f 1 2"), 3, "line 4");
    expect_bake_fails(file("nan.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), 3, "line 1");
    expect_bake_fails(file("none.obj", vertices), 3, "no triangles");
    expect_bake_fails(file("range.obj", vertices + "f 1 2 4\n"), 3, "does not exist");
    expect_bake_fails(file("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n"), 3, "no triangle with an area");
    expect_bake_fails(file("mesh.xyz", vertices), 3, "unknown kind");
    expect_bake_fails(file("rubbish.glb", "rubbish"), 3, "");
    // Not a number where only clean() can see it: binary STL.
    std::string stl(84 + 50, '\0');
    stl[80] = 1;
    const float corners[9] = {0, 0, 0, 1, 0, 0, 0, std::nanf(""), 0};
    std::copy_n(reinterpret_cast<const char*>(corners), sizeof corners, stl.begin() + 84 + 12);
    expect_bake_fails(file("nan.stl", stl), 3, "not finite (triangle 1)");
}

TEST_F(Cli, WrongUsageIsOneLineWithAHint) {
    const std::string mesh = shared("peanut.obj"), out = file("out.etree");
    const auto bake_with = [&](std::vector<std::string> more) {
        more.insert(more.begin(), {"bake", mesh, "-o", out});
        return run(more);
    };
    expect_failure(run({}), 2, "usage", "no command");
    expect_failure(run({"bkae", mesh}), 2, "bkae", "did you mean 'bake'?");
    expect_failure(run({"frobnicate"}), 2, "frobnicate", "prolate --help");
    expect_failure(run({"bake", mesh}), 2, "bake", "--output");
    expect_failure(run({"bake", mesh, "--ouput", out}), 2, "--ouput", "did you mean '--output'?");
    expect_failure(bake_with({"--levles=3"}), 2, "--levles", "did you mean '--levels'?");
    expect_failure(bake_with({"surplus"}), 2, "bake", "surplus");
    expect_failure(bake_with({"--degree", "many"}), 2, "bake", "degree");
    expect_failure(bake_with({"--degree", "1"}), 2, "bake", "degree must be 2 to 64");
    expect_failure(bake_with({"--degree", "-4"}), 2, "bake", "degree");
    expect_failure(bake_with({"--levels", "0"}), 2, "--levels", "1 to 31");
    expect_failure(bake_with({"--levels", "32"}), 2, "bake", "1 to 31");
    expect_failure(bake_with({"--ellipsoids", "0"}), 2, "--ellipsoids", "1 to 65536");
    expect_failure(bake_with({"--ellipsoids", "65537"}), 2, "bake", "1 to 65536");
    expect_failure(bake_with({"--tolerance", "0"}), 2, "--tolerance", "above 0");
    expect_failure(bake_with({"--tolerance", "nan"}), 2, "bake", "tolerance");
    expect_failure(bake_with({"--levels", "2", "--tolerance", "0.1"}), 2, "bake", "only one");
    expect_failure(bake_with({"--clearance", "5"}), 2, "--clearance", "has no unit");
    expect_failure(bake_with({"--clearance", "5parsec"}), 2, "--clearance", "no unit 'parsec'");
    expect_failure(bake_with({"--clearance", "0mm"}), 2, "--clearance", "not above 0");
    expect_failure(bake_with({"--fill", "-2in"}), 2, "--fill", "not above 0");
    expect_failure(bake_with({"--keep-holes", "wide"}), 2, "--keep-holes", "no length");
    expect_failure(bake_with({"--clearance", "1%"}), 2, "--clearance", "--distance 1");
    expect_failure(bake_with({"--fill", "1m", "--keep-holes", "1m"}), 2, "bake", "only one");
    expect_failure(bake_with({"--exact", "--fill", "1m"}), 2, "bake", "exact");
    expect_failure(bake_with({"--alpha", "-1"}), 2, "bake", "alpha");
    expect_failure(bake_with({"--quality", "superb"}), 2, "--quality", "fast, normal or best");
    expect_failure(bake_with({"--method", "guess"}), 2, "--method", "no such method");
    expect_failure(bake_with({"--primitive", "torus"}), 2, "--primitive", "no such primitive");
    expect_failure(bake_with({"--exact", "--levels", "2"}), 2, "bake", "no levels");
    expect_failure(bake_with({"--exact", "--leaf-triangles", "128"}), 2, "bake", "1 to 127");
    expect_failure(bake_with({"--report", out}), 2, out, "is the output");
    expect_failure(run({"bake", mesh, "-o", mesh}), 2, mesh, "is the mesh");
    EXPECT_TRUE(listing().empty());
}

// ---- lengths ----

// The peanut's box is 4 m long, 4.5 m in diagonal or so.
TEST_F(Cli, WhatCannotBeHadIsRefusedWithTheNearestThatCan) {
    const auto bake_with = [&](std::vector<std::string> more) {
        more.insert(more.begin(), {"bake", shared("peanut.obj"), "-o", file("out.etree"), "--quality", "fast", "-q"});
        return run(more);
    };
    expect_failure(bake_with({"--clearance", "0.1mm"}), 2, "--clearance", "the least is 4.");
    expect_failure(bake_with({"--distance", "0.01"}), 2, "--distance", "the least is 0.1");
    expect_failure(bake_with({"--fill", "9m"}), 2, "--fill",
                   "too large for a mesh whose longest side is 4m; the largest is 2m");
    expect_failure(bake_with({"--keep-holes", "1mm"}), 2, "--keep-holes", "the least is 62.5mm");
    const std::string mesh = shared("peanut.obj");
    const Outcome few = bake_with({"--ellipsoids", "2", "--clearance", "5cm"});
    expect_failure(few, 1, mesh, "at most 2 ellipsoids reach a clearance of ");
    EXPECT_NE(few.err.find("cm instead of 5cm; the nearest that can be had is --clearance "), std::string::npos);
    EXPECT_TRUE(listing().empty());
    // What it says can be had, can.
    const size_t at = few.err.find("--clearance ") + 12;
    const std::string nearest = few.err.substr(at, few.err.find(',', at) - at);
    const Outcome met = bake_with({"--ellipsoids", "2", "--clearance", nearest});
    EXPECT_EQ(met.code, 0) << met.err;
    expect_failure(bake_with({"--keep-holes", "20cm"}), 2, mesh, "no such ball passes a hole");
}

TEST_F(Cli, ALengthIsMetWithAsFewAsNeeded) {
    const std::string out = file("out.etree");
    const Outcome baked = run({"bake", shared("peanut.obj"), "-o", out, "--quality", "fast", "--ellipsoids", "64",
                               "--clearance", "20cm", "--json"});
    ASSERT_EQ(baked.code, 0) << baked.err;
    const Json report = Json::parse(baked.out);
    EXPECT_TRUE(report["goal_reached"]);
    EXPECT_LE(report["levels"].back()["hausdorff_max"], 0.2);
    EXPECT_LT(report["levels"].back()["nodes"], 64);
    EXPECT_GT(report["levels"].back()["nodes"], 1);
    const std::string info = run({"info", out}).out;
    EXPECT_NE(info.find("asked     at most 64 leaves"), std::string::npos) << info;
    EXPECT_NE(info.find("% of the diagonal (0.2)"), std::string::npos) << info;
}

TEST_F(Cli, AFilledTreeSaysSoAndIsVerified) {
    // A cube, 2 m wide, without its upper side: a ball sits in the opening, and all below it is filled.
    Mesh open = box_mesh(4, [](double x, double y, double z) {
        return Vec3{static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)};
    });
    std::erase_if(open.triangles, [&](const Triangle& t) {
        return open.vertices[t[0]].z + open.vertices[t[1]].z + open.vertices[t[2]].z == 3;
    });
    const std::string mesh = file("open.obj", obj_text(open)), out = file("out.etree");
    const Outcome baked = run({"bake", mesh, "-o", out, "--quality", "fast", "--levels", "1", "--fill", "60cm"});
    ASSERT_EQ(baked.code, 0) << baked.err;
    EXPECT_EQ(baked.err.find("open edges"), std::string::npos) << baked.err; // the filled solid has none
    EXPECT_NE(run({"info", out}).out.find("filled    what a ball of radius 0.6 cannot reach"), std::string::npos);
    EXPECT_EQ(Json::parse(run({"info", out, "--json"}).out)["fill"], 0.6);
    const Outcome verified = run({"verify", out, mesh});
    EXPECT_EQ(verified.code, 0) << verified.out << verified.err;
    EXPECT_EQ(verified.out.find("surface mode"), std::string::npos);
}

// ---- writing ----

TEST_F(Cli, AnInnerCoverThroughEveryCommand) {
    const std::string mesh = file("peanut.obj", obj_text(peanut(8))), tree = file("a.etree");
    const Outcome baked = run({"bake", mesh, "-o", tree, "--ellipsoids", "4", "--quality", "fast", "--inner", "6"});
    ASSERT_EQ(baked.code, 0) << baked.err;
    EXPECT_NE(baked.out.find("  inside    6 ellipsoids"), std::string::npos) << baked.out;
    const Json info = Json::parse(run({"info", tree, "--json"}).out);
    EXPECT_EQ(info["format_version"], 9);
    EXPECT_EQ(info["inner"]["ellipsoids"], 6);
    EXPECT_GT(info["inner"]["share_of_solid"], 0.6);
    EXPECT_TRUE(info["unknown_sections"].empty());
    EXPECT_NE(run({"info", tree}).out.find("% of the solid; proved"), std::string::npos);
    EXPECT_NE(run({"verify", tree, mesh}).out.find("inner cover: inside the solid, proved"), std::string::npos);

    const auto solids = [&](const char* pose) {
        return Json::parse(run({"collide", tree, tree, "--pose", pose, "--json"}).out)["solids"];
    };
    const Json meeting = solids("0.1,0,0"), apart = solids("5,0,0");
    EXPECT_EQ(meeting["verdict"], "overlapping");
    EXPECT_EQ(meeting["upper"], 0);
    EXPECT_GT(meeting["depth_lower"], 0);
    EXPECT_EQ(apart["verdict"], "separated");
    EXPECT_LE(apart["lower"], apart["upper"]);
    EXPECT_EQ(apart["depth_upper"], 0);
    EXPECT_NE(run({"collide", tree, tree}).out.find("\nsolids: certainly meet, depth "), std::string::npos);
    EXPECT_NE(run({"collide", tree, tree, "--pose", "5,0,0"}).out.find("\nsolids: certainly apart, "),
              std::string::npos);
    EXPECT_NE(run({"collide", tree, tree, "--budget", "0"}).out.find("\nsolids: within the band"), std::string::npos);

    Mesh moved = peanut(8);
    for (Vec3& v : moved.vertices) v.x += 0.05f;
    const Outcome no = run({"verify", tree, file("moved.obj", obj_text(moved)), "--json"});
    EXPECT_EQ(no.code, 1);
    EXPECT_FALSE(Json::parse(no.out)["inner_inside"]);

    moved.triangles.pop_back(); // open
    const Outcome open = run({"bake", file("open.obj", obj_text(moved)), "-o", file("b.etree"), "--inner", "6"});
    EXPECT_EQ(open.code, 3);
    EXPECT_NE(open.err.find("an open mesh has no inside for an inner cover"), std::string::npos) << open.err;
    EXPECT_FALSE(fs::exists(file("b.etree")));
}

// An array of numpy's, of floats.
std::string npy(const std::string& shape, const std::vector<float>& values) {
    std::string header = "{'descr': '<f4', 'fortran_order': False, 'shape': (" + shape + "), }";
    header += std::string(117 - header.size(), ' ') + '\n'; // 128 bytes with what is before
    const auto size = static_cast<char>(header.size());
    std::string out = std::string("\x93NUMPY\x01", 7) + '\0' + size + '\0' + header;
    return out.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float));
}

// A cube of two bones and a morph target, the weight of whose first vertex for the first bone is `first`.
std::string skinned_glb(float first) {
    const Mesh mesh = cube();
    const size_t n = mesh.vertices.size();
    std::string data, views, accessors;
    const auto add = [&](const void* from, size_t size, const std::string& words) {
        const std::string at = std::to_string(data.size()),
                          index = std::to_string(std::count(views.begin(), views.end(), '{'));
        views += (views.empty() ? "" : ",") + (R"({"buffer":0,"byteOffset":)" + at) + R"(,"byteLength":)" +
                 std::to_string(size) + "}";
        accessors += (accessors.empty() ? "" : ",") + (R"({"bufferView":)" + index) + "," + words + "}";
        data.append(static_cast<const char*>(from), size);
    };
    const std::string rows = R"("count":)" + std::to_string(n);
    std::vector<float> weights, up(3 * n);
    std::vector<uint8_t> joints;
    for (size_t v = 0; v < n; ++v) {
        const float w = v == 0 ? first : mesh.vertices[v].x > 0 ? 0.25f : 1;
        weights.insert(weights.end(), {w, mesh.vertices[v].x > 0 ? 0.75f : 0, 0, 0});
        joints.insert(joints.end(), {0, 1, 0, 0});
        up[3 * v + 2] = mesh.vertices[v].z;
    }
    add(mesh.vertices.data(), 12 * n, R"("componentType":5126,"type":"VEC3",)" + rows);
    add(mesh.triangles.data(), 12 * mesh.triangles.size(),
        R"("componentType":5125,"type":"SCALAR","count":)" + std::to_string(3 * mesh.triangles.size()));
    add(joints.data(), joints.size(), R"("componentType":5121,"type":"VEC4",)" + rows);
    add(weights.data(), 16 * n, R"("componentType":5126,"type":"VEC4",)" + rows);
    add(up.data(), 12 * n, R"("componentType":5126,"type":"VEC3",)" + rows);
    std::string json =
        R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0,"skin":0},{},{}],)"
        R"("skins":[{"joints":[1,2]}],"meshes":[{"primitives":[{"attributes":{"POSITION":0,"JOINTS_0":2,)"
        R"("WEIGHTS_0":3},"indices":1,"targets":[{"POSITION":4}]}]}],"buffers":[{"byteLength":)" +
        std::to_string(data.size()) + R"(}],"bufferViews":[)" + views + R"(],"accessors":[)" + accessors + "]}";
    json.append((4 - json.size() % 4) % 4, ' ');
    std::string out = "glTF";
    const auto put = [&out](size_t x) {
        const auto word = static_cast<uint32_t>(x);
        out.append(reinterpret_cast<const char*>(&word), 4);
    };
    put(2), put(12 + 8 + json.size() + 8 + data.size());
    put(json.size()), out += "JSON", out += json;
    put(data.size()), out.append("BIN\0", 4);
    return out + data;
}

TEST_F(Cli, BakeTakesSkinsAndMorphTargetsOfGltf) {
    const float first = cube().vertices[0].x > 0 ? 0.25f : 1;
    const std::string mesh = file("cube.glb", skinned_glb(first)), tree = file("a.etree");
    const std::vector<std::string> words{"bake", mesh, "-o", tree, "--ellipsoids", "1", "--quality", "fast", "--skin"};
    const Outcome good = run(words);
    ASSERT_EQ(good.code, 0) << good.err;
    EXPECT_NE(good.out.find("by 1 mode, coordinates within 1; proved; "), std::string::npos) << good.out;
    EXPECT_NE(good.out.find("by 2 bones, at all matrices; proved; "), std::string::npos) << good.out;
    const Json info = Json::parse(run({"info", tree, "--json"}).out);
    EXPECT_EQ(info["bones"], 2);
    EXPECT_GT(info["skin_bytes"], 0);
    const Outcome blind = run({"verify", tree, mesh});
    EXPECT_EQ(blind.code, 0);
    EXPECT_NE(blind.err.find("not proved without them; give --skin"), std::string::npos) << blind.err;
    const Outcome proved = run({"verify", tree, mesh, "--skin"});
    EXPECT_EQ(proved.code, 0) << proved.err;
    EXPECT_NE(proved.out.find("modes: the nodes hold the mesh"), std::string::npos) << proved.out;
    EXPECT_NE(proved.out.find("bones: the nodes hold the mesh at all matrices"), std::string::npos) << proved.out;

    // What is wrong is one line, and no file.
    const auto fails = [&](const Outcome& bad, int code, const char* text) {
        EXPECT_EQ(bad.code, code);
        EXPECT_NE(bad.err.find(text), std::string::npos) << bad.err;
        EXPECT_FALSE(fs::exists(file("b.etree")));
    };
    const auto bake = [&](const std::string& from, std::initializer_list<std::string> options) {
        std::vector<std::string> command{"bake", from,     "-o",        file("b.etree"), "--ellipsoids",
                                         "1",    "--skin", "--quality", "fast"};
        command.insert(command.end(), options);
        return run(command);
    };
    fails(bake(file("odd.glb", skinned_glb(first + 0.5f)), {}), 3, "do not add up to 1");
    fails(bake(file("cube.obj", obj_text(cube())), {}), 3, "only glTF files");
    fails(bake(mesh, {"--modes", "u.npy"}), 2, "--skin");
    fails(bake(mesh, {"--range", "1,2"}), 2, "1 morph targets");
}

TEST_F(Cli, BakeTakesModesFromNumpysFiles) {
    const std::string mesh = file("cube.obj", obj_text(cube())), tree = file("a.etree");
    const size_t vertices = cube().vertices.size();
    const std::string shape = "2, " + std::to_string(vertices) + ", 3";
    std::vector<float> u(6 * vertices, 0.25f); // two translations
    const auto bake = [&](const std::string& modes, std::initializer_list<std::string> options) {
        std::vector<std::string> words{"bake", mesh,        "-o",   tree,      "--ellipsoids",
                                       "1",    "--quality", "fast", "--modes", modes};
        words.insert(words.end(), options);
        return run(words);
    };
    const Outcome good = bake(file("u.npy", npy(shape, u)), {"--range", "0.5,2"});
    ASSERT_EQ(good.code, 0) << good.err;
    EXPECT_NE(run({"info", tree}).out.find("by 2 modes, coordinates within 0.5, 2; proved; "), std::string::npos);
    const Json info = Json::parse(run({"info", tree, "--json"}).out);
    EXPECT_GT(info["modes_bytes"], 8 * 2 * 8);
    // verify proves them, and notices others.
    const Outcome blind = run({"verify", tree, mesh});
    EXPECT_EQ(blind.code, 0);
    EXPECT_NE(blind.err.find("not proved without its modes; give --modes"), std::string::npos) << blind.err;
    const Outcome proved = run({"verify", tree, mesh, "--modes", file("u.npy")});
    EXPECT_EQ(proved.code, 0) << proved.err;
    EXPECT_NE(proved.out.find("modes: the nodes hold the mesh"), std::string::npos) << proved.out;
    std::vector<float> further = u;
    for (size_t i = 3 * vertices; i < further.size(); ++i) further[i] = 0.5f; // of the second mode
    const Outcome refuted = run({"verify", tree, mesh, "--modes", file("v.npy", npy(shape, further)), "--json"});
    EXPECT_EQ(refuted.code, 1) << refuted.err;
    EXPECT_EQ(Json::parse(refuted.out)["modes_hold"], false);
    EXPECT_EQ(Json::parse(refuted.out)["covered"], true);
    const Outcome fewer =
        run({"verify", tree, mesh, "--modes",
             file("one.npy", npy("1, " + std::to_string(vertices) + ", 3", {u.begin(), u.begin() + 3 * vertices}))});
    EXPECT_EQ(fewer.code, 3);
    EXPECT_NE(fewer.err.find("one.npy"), std::string::npos) << fewer.err;
    EXPECT_EQ(info["mode_ranges"], (std::vector<double>{0.5, 2}));
    EXPECT_TRUE(info["unknown_sections"].empty());
    // Pictures of it as it moves.
    const auto render = [&](std::initializer_list<std::string> options) {
        std::vector<std::string> words{"render", tree, mesh, "-o", file("at.png"), "--size", "300x120", "--force"};
        words.insert(words.end(), options);
        return run(words);
    };
    const std::string u_file = file("u.npy");
    EXPECT_EQ(render({"--modes", u_file, "--mesh", "overlay", "--at", "0.5,-2", "--at", "-0.5,0"}).code, 0);
    EXPECT_EQ(render({"--at", "0.5,-2"}).code, 0);
    expect_failure(render({"--mesh", "overlay", "--at", "0,0"}), 2, "--mesh overlay",
                   "how the mesh moves is not known");
    expect_failure(render({"--at", "0.6,0"}), 2, "--at 0.6,0", "mode 1 goes from -0.5 to 0.5");
    expect_failure(render({"--at", "nan,0"}), 2, "--at nan,0", "mode 1 goes from");
    expect_failure(render({"--at", "0.5"}), 2, "--at 0.5", "1 coordinate for 2 modes");
    expect_failure(render({"--at", "0.5,"}), 2, "--at 0.5,", "not numbers");
    expect_failure(render({"--heat", "--at", "0,0"}), 2, "--heat", "at rest");
    EXPECT_EQ(run({"view", tree, mesh, "--modes", u_file, "-o", file("page.html")}).code, 0);
    expect_failure(run({"view", tree, "--modes", u_file, "-o", file("page.html")}), 2, "--modes", "there is no mesh");
    // The same options without modes are another file.
    EXPECT_EQ(run({"bake", mesh, "-o", tree, "--ellipsoids", "1", "--quality", "fast"}).code, 0);
    expect_failure(render({"--at", "0,0"}), 2, "--at 0,0", "the tree has no modes");
    EXPECT_TRUE(Json::parse(run({"info", tree, "--json"}).out)["mode_ranges"].empty());
    expect_failure(run({"verify", tree, mesh, "--modes", file("u.npy")}), 2, file("u.npy"), "does not deform");

    fs::remove(tree);
    u[7] = std::numeric_limits<float>::quiet_NaN();
    const std::vector<std::pair<Outcome, const char*>> cases = {
        {bake(file("nan.npy", npy(shape, u)), {"--range", "1"}), "vertex displacement is not finite (index 2)"},
        {bake(file("short.npy", npy("1, 2, 3", std::vector<float>(6))), {"--range", "1"}),
         "another number of vertices"},
        {bake(file("cut.npy", npy(shape, {1, 2})), {"--range", "1"}), "is cut off"},
        {bake(file("u.npy", npy(shape, std::vector<float>(6 * vertices))), {}), "give --range"},
        {bake(mesh, {"--range", "1"}), "is no array of numpy's"},
        {bake(file("zip.npz", "PK and no more"), {}), "holds no array \"modes\""}};
    for (const auto& [outcome, words] : cases) {
        EXPECT_NE(outcome.code, 0) << words;
        EXPECT_NE(outcome.err.find(words), std::string::npos) << words << " is not in: " << outcome.err;
        EXPECT_FALSE(fs::exists(tree)) << words;
    }
    EXPECT_EQ(run({"bake", mesh, "-o", tree, "--range", "1"}).code, 2);
}

TEST_F(Cli, AMissingFolderIsFoundBeforeTheWork) {
    const std::string out = file("nowhere/out.etree");
    expect_failure(run({"bake", file("missing.obj"), "-o", out}), 4, out, "does not exist");
    expect_failure(run({"bake", shared("peanut.obj"), "-o", file("a.etree"), "--report", out}), 4, out,
                   "does not exist");
    expect_failure(run({"export", shared("peanut.etree"), "-o", file("nowhere/a.csv")}), 4, file("nowhere/a.csv"),
                   "does not exist");
    expect_failure(run({"bake", shared("peanut.obj"), "-o", folder_.string()}), 4, folder_.string(), "directory");
    EXPECT_TRUE(listing().empty());
}

TEST_F(Cli, NoSpaceLeft) {
    const std::string tree = shared("peanut.etree");
    expect_failure(run({"export", tree, "-o", "/dev/full", "--format", "csv"}), 4, "/dev/full", "No space left");
    RunOptions full;
    full.stdout_path = "/dev/full";
    expect_failure(run({"info", tree}, full), 4, "standard output", "No space left");
    expect_failure(run({"export", tree, "-o", "-", "--format", "csv"}, full), 4, "standard output", "No space left");
    expect_failure(run({"--help"}, full), 4, "standard output", "No space left");

    RunOptions limited;
    limited.in_child = [] {
        const rlimit limit{1024, 1024};
        ::setrlimit(RLIMIT_FSIZE, &limit);
    };
    const std::string old = file("out.csv", "level,cx,cy,cz,old content");
    expect_failure(run({"export", tree, "-o", old}, limited), 4, old, "File too large");
    EXPECT_EQ(read(old), "level,cx,cy,cz,old content");
    expect_failure(run({"export", tree, "-o", file("new.csv")}, limited), 4, file("new.csv"), "File too large");
    EXPECT_EQ(listing(), std::vector<std::string>{"out.csv"}) << "no part and no temporary file is left";
}

TEST_F(Cli, CtrlCLeavesTheOldFile) {
    const std::string mesh = file("large.obj", obj_text(peanut(60))),
                      out = file("out.etree", read(shared("peanut.etree")));
    for (const int milliseconds : {0, 400, 1500}) { // while the mesh is read, and in the midst of the work
        RunOptions interrupt;
        interrupt.interrupt_after = std::chrono::milliseconds(milliseconds);
        const Outcome o = run({"bake", mesh, "-o", out, "--quality", "best", "--ellipsoids", "20000"}, interrupt);
        expect_failure(o, 130, milliseconds == 0 && o.err.starts_with("prolate: bake") ? "bake" : mesh, "interrupted");
        EXPECT_EQ(read(out), read(shared("peanut.etree")));
        EXPECT_EQ(listing(), (std::vector<std::string>{"large.obj", "out.etree"}));
    }
}

TEST_F(Cli, LinksGoOnPointingAtTheirFile) {
    const std::string target = file("target.csv", "");
    fs::create_symlink(target, folder_ / "link.csv");
    EXPECT_EQ(run({"export", shared("peanut.etree"), "-o", file("link.csv")}).code, 0);
    EXPECT_TRUE(fs::is_symlink(folder_ / "link.csv"));
    EXPECT_TRUE(read(target).starts_with("level,"));
}

// ---- what is not done twice ----

// Of a file: what changes when it is written anew, even with the same bytes.
ino_t identity(const std::string& path) {
    struct stat status {};
    return ::stat(path.c_str(), &status) == 0 ? status.st_ino : 0;
}

TEST_F(Cli, AnUnchangedAssetIsNotBakedAgain) {
    const std::string mesh = file("cube.obj", obj_text(cube())), tree = file("cube.etree");
    const std::vector<std::string> bake{"bake", mesh, "-o", tree, "--ellipsoids", "1", "--quality", "fast", "--json"};
    const auto with = [&bake](std::vector<std::string> more) {
        more.insert(more.begin(), bake.begin(), bake.end());
        return run(more);
    };
    const Json first = Json::parse(run(bake).out);
    EXPECT_EQ(first["source"], "baked");
    const std::string bytes = read(tree);
    const ino_t inode = identity(tree);

    fs::last_write_time(mesh, fs::file_time_type::clock::now() + std::chrono::hours(1)); // dates do not matter
    const Outcome again = run(bake);
    EXPECT_EQ(again.code, 0) << again.err;
    EXPECT_NE(again.err.find(tree + ": unchanged"), std::string::npos) << again.err;
    EXPECT_EQ(identity(tree), inode);
    Json second = Json::parse(again.out);
    EXPECT_EQ(second["source"], "unchanged");
    EXPECT_TRUE(second["levels"][0]["seconds"].is_null());
    second["levels"][0]["seconds"] = first["levels"][0]["seconds"];
    EXPECT_EQ(second["levels"], first["levels"]);
    EXPECT_EQ(second["diagnosis"], first["diagnosis"]);

    EXPECT_EQ(Json::parse(with({"--threads", "1"}).out)["source"], "unchanged") << "it does not change the bytes";
    // The report is written in any case.
    EXPECT_EQ(with({"--report", file("report.json")}).code, 0);
    EXPECT_EQ(Json::parse(read(file("report.json")))["source"], "unchanged");

    EXPECT_EQ(Json::parse(with({"--rebake"}).out)["source"], "baked");
    EXPECT_EQ(read(tree), bytes);
    EXPECT_NE(identity(tree), inode);

    EXPECT_EQ(Json::parse(with({"--seed", "4"}).out)["source"], "baked") << "another option";
    EXPECT_NE(read(tree), bytes);
    EXPECT_EQ(Json::parse(run(bake).out)["source"], "baked") << "and back";
    EXPECT_EQ(read(tree), bytes);
    write(mesh, obj_text(cube(1.5f)));
    EXPECT_EQ(Json::parse(run(bake).out)["source"], "baked") << "another mesh by the same name";
    EXPECT_NE(read(tree), bytes);
    write(mesh, obj_text(cube()));

    std::string damaged = bytes;
    damaged[damaged.size() - 20] ^= 1;
    write(tree, damaged);
    EXPECT_EQ(Json::parse(run(bake).out)["source"], "baked");
    EXPECT_EQ(read(tree), bytes);
    // A prefix is a sound tree, but a coarser one.
    const std::string whole = read(shared("peanut.etree"));
    const std::string prefix =
        file("prefix.etree", whole.substr(0, Json::parse(read(shared("report.json")))["levels"][1]["bytes"]));
    EXPECT_EQ(run({"info", prefix}).code, 0);
    EXPECT_EQ(
        run({"bake", shared("peanut.obj"), "-o", prefix, "--levels", "2", "--degree", "4", "--quality", "fast"}).code,
        0);
    EXPECT_EQ(read(prefix), whole);
}

TEST_F(Cli, TheCacheServesEveryOutput) {
    const std::string mesh = file("cube.obj", obj_text(cube())), cache = file("a/cache");
    const auto bake = [&](const std::string& output) {
        return run({"bake", mesh, "-o", output, "--ellipsoids", "1", "--quality", "fast", "--json", "--cache", cache});
    };
    const auto source = [&](const std::string& output) { return Json::parse(bake(output).out)["source"]; };
    const auto entry = [&](const char* ending) {
        std::string found;
        for (const auto& e : fs::directory_iterator(cache))
            if (e.path().extension() == ending) {
                EXPECT_EQ(std::exchange(found, e.path().string()), "");
            }
        return found;
    };
    EXPECT_EQ(source(file("one.etree")), "baked");
    const std::string bytes = read(file("one.etree"));
    EXPECT_EQ(read(entry(".etree")), bytes);

    const Json cached = Json::parse(bake(file("two.etree")).out);
    EXPECT_EQ(cached["source"], "cached");
    EXPECT_TRUE(cached["diagnosis"].is_null()) << "the mesh was not even imported";
    EXPECT_EQ(read(file("two.etree")), bytes);
    const Json unchanged = Json::parse(bake(file("two.etree")).out);
    EXPECT_EQ(unchanged["source"], "unchanged");
    EXPECT_TRUE(unchanged["diagnosis"].is_null());
    // The same mesh in another file: it has to be read, and is recognised then.
    const std::string copy = file("copy.obj", "# comment\n" + obj_text(cube()));
    const Json other = Json::parse(run({"bake", copy, "-o", file("copy.etree"), "--ellipsoids", "1", "--quality",
                                        "fast", "--json", "--cache", cache})
                                       .out);
    EXPECT_EQ(other["source"], "cached");
    EXPECT_FALSE(other["diagnosis"].is_null());
    fs::remove(copy);

    // A damaged tree is found and replaced.
    std::string damaged = bytes;
    damaged[damaged.size() - 20] ^= 1;
    write(entry(".etree"), damaged);
    const Outcome repaired = bake(file("three.etree"));
    EXPECT_EQ(Json::parse(repaired.out)["source"], "baked");
    EXPECT_NE(repaired.err.find("damaged cache entry"), std::string::npos) << repaired.err;
    EXPECT_EQ(read(file("three.etree")), bytes);
    EXPECT_EQ(read(entry(".etree")), bytes);
    // So is a sound one under a wrong name.
    write(entry(".etree"), read(shared("peanut.etree")));
    const Outcome renamed = bake(file("four.etree"));
    EXPECT_EQ(Json::parse(renamed.out)["source"], "baked");
    EXPECT_NE(renamed.err.find("not what its name says"), std::string::npos) << renamed.err;
    EXPECT_EQ(read(file("four.etree")), bytes);
    // A damaged .mesh entry costs an import and no more.
    for (const auto& e : fs::directory_iterator(cache))
        if (e.path().extension() == ".mesh") {
            std::string content = read(e.path());
            content[20] ^= 1;
            write(e.path(), content);
        }
    const Json read_again = Json::parse(bake(file("four.etree")).out);
    EXPECT_EQ(read_again["source"], "unchanged");
    EXPECT_FALSE(read_again["diagnosis"].is_null());
    EXPECT_TRUE(Json::parse(bake(file("four.etree")).out)["diagnosis"].is_null()) << "the entry is sound again";

    // The environment names it as well, and an output from before fills it.
    fs::remove_all(cache);
    ::setenv("PROLATE_CACHE", cache.c_str(), 1);
    const Outcome filled = run({"bake", mesh, "-o", file("one.etree"), "--ellipsoids", "1", "--quality", "fast"});
    ::unsetenv("PROLATE_CACHE");
    EXPECT_NE(filled.err.find("unchanged"), std::string::npos) << filled.err;
    EXPECT_EQ(read(entry(".etree")), bytes);
}

TEST_F(Cli, ACacheThatCannotBeWrittenIsLeftOut) {
    const std::string mesh = file("cube.obj", obj_text(cube())), cache = file("no folder", "") + "/cache";
    const Outcome o =
        run({"bake", mesh, "-o", file("cube.etree"), "--ellipsoids", "1", "--quality", "fast", "--cache", cache});
    EXPECT_EQ(o.code, 0);
    const std::string words = cache + ": the cache folder is left out";
    EXPECT_NE(o.err.find(words), std::string::npos) << o.err;
    EXPECT_EQ(o.err.find(words), o.err.rfind(words)) << "said once: " << o.err;
    EXPECT_TRUE(fs::exists(file("cube.etree")));
}

// A tetrahedron whose fourth corner is at the given height; the numbers are in a file of their own.
void write_gltf(const fs::path& folder, float height) {
    const float corners[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, height};
    const uint16_t indices[] = {0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3};
    write(folder / "shape.bin", std::string(reinterpret_cast<const char*>(corners), sizeof corners) +
                                    std::string(reinterpret_cast<const char*>(indices), sizeof indices));
    write(folder / "shape.gltf", R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"uri": "shape.bin", "byteLength": 72}],
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 24}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 9]},
                      {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"}]})");
}

TEST_F(Cli, AMeshInSeveralFilesIsKnownByAllOfThem) {
    const auto source = [this](const std::string& output) {
        const Outcome o = run({"bake", file("shape.gltf"), "-o", file(output), "--ellipsoids", "1", "--quality", "fast",
                               "--json", "--cache", file("cache")});
        EXPECT_EQ(o.code, 0) << o.err;
        return Json::parse(o.out)["source"];
    };
    write_gltf(folder_, 1);
    EXPECT_EQ(source("one.etree"), "baked");
    EXPECT_EQ(source("one.etree"), "unchanged");
    EXPECT_EQ(source("two.etree"), "cached");
    write_gltf(folder_, 2); // the .gltf itself stays the same
    EXPECT_EQ(source("one.etree"), "baked");
    EXPECT_NE(read(file("one.etree")), read(file("two.etree")));
    EXPECT_EQ(source("two.etree"), "cached");
}

// ---- manifests ----

TEST_F(Cli, AManifestBakesAllThatItCan) {
    fs::create_directory(folder_ / "in");
    const std::string good = obj_text(cube());
    write(folder_ / "in/cube.obj", good);
    write(folder_ / "in/broken.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n");
    const std::string manifest = file("assets.json", R"({
        "defaults": {"quality": "fast", "ellipsoids": 1},
        "assets": [
          {"mesh": "in/cube.obj", "output": "one.etree"},
          {"mesh": "in/broken.obj", "output": "broken.etree"},
          {"mesh": "in/missing.obj", "output": "missing.etree"},
          {"mesh": "in/cube.obj", "output": "levels.etree", "levels": 1, "degree": 3, "report": "levels.json"}
        ]})");
    const Outcome o = run({"bake", "--manifest", manifest}); // from another folder: paths are the manifest's
    EXPECT_EQ(o.code, 1);
    for (const char* words : {"asset 1 (in/cube.obj): ", "one.etree: baked", "asset 2 (in/broken.obj): ",
                              "no triangles", "asset 3 (in/missing.obj): ", "No such file", "2 of 4 assets failed"})
        EXPECT_NE(o.err.find(words), std::string::npos) << words << " in\n" << o.err;
    EXPECT_LT(o.err.find("No such file"), o.err.find("one.etree: baked")) << "said before the work:\n" << o.err;
    for (const char* words : {"asset", "nodes", "outside ratio", "bytes", "seconds", "failed: "})
        EXPECT_NE(o.out.find(words), std::string::npos) << words << " in\n" << o.out;
    EXPECT_EQ(std::count(o.out.begin(), o.out.end(), '\n'), 5) << "a heading and a row each:\n" << o.out;
    EXPECT_EQ(listing(), (std::vector<std::string>{"assets.json", "in", "levels.etree", "levels.json", "one.etree"}));
    EXPECT_EQ(Json::parse(run({"info", file("one.etree"), "--json"}).out)["asked"]["ellipsoids"], 1);
    const Json levels = Json::parse(run({"info", file("levels.etree"), "--json"}).out);
    EXPECT_EQ(levels["asked"]["levels"], 1) << "an entry's count replaces the defaults' one";
    EXPECT_EQ(levels["asked"]["ellipsoids"], 0);
    EXPECT_EQ(levels["degree"], 3);
    EXPECT_EQ(levels["quality"], "fast");
    EXPECT_EQ(Json::parse(read(file("levels.json")))["degree"], 3);

    write(folder_ / "in/broken.obj", good);
    const Outcome second = run({"bake", "--manifest", manifest, "--json", "--report", file("summary.json")});
    EXPECT_EQ(second.code, 1);
    const Json summary = Json::parse(second.out);
    EXPECT_EQ(summary, Json::parse(read(file("summary.json"))));
    EXPECT_EQ(summary["baked"], 1);
    EXPECT_EQ(summary["unchanged"], 2);
    EXPECT_EQ(summary["cached"], 0);
    EXPECT_EQ(summary["failed"], 1);
    EXPECT_EQ(summary["not_done"], 0);
    ASSERT_EQ(summary["assets"].size(), 4u);
    EXPECT_EQ(summary["assets"][0]["asset"], 1);
    EXPECT_EQ(summary["assets"][0]["source"], "unchanged");
    EXPECT_EQ(summary["assets"][1]["source"], "baked");
    EXPECT_EQ(summary["assets"][1]["levels"].back()["covered"], true);
    EXPECT_NE(summary["assets"][2]["error"].get<std::string>().find("No such file"), std::string::npos);
    EXPECT_FALSE(summary["assets"][0].contains("error"));

    write(folder_ / "in/missing.obj", good);
    EXPECT_EQ(run({"bake", "--manifest", manifest}).code, 0);
    const Outcome forced = run({"bake", "--manifest", manifest, "--rebake", "--threads", "1", "--json"});
    EXPECT_EQ(forced.code, 0) << forced.err;
    EXPECT_EQ(Json::parse(forced.out)["baked"], 4);
}

TEST_F(Cli, BadEntriesAreToldInOneLineEach) {
    write(folder_ / "cube.obj", obj_text(cube()));
    const struct {
        const char *entry, *words;
    } cases[] = {
        {R"({"mesh": "cube.obj", "output": "a.etree", "levels": 1, "quality": "fast"})", nullptr},
        {R"({"mesh": "cube.obj", "output": "./a.etree"})", "the output of asset 1"},
        {R"({"mesh": "cube.obj", "output": "b.etree", "report": "a.etree"})", "the output of asset 1"},
        {R"({"mesh": "cube.obj", "output": "c.etree", "levles": 2})",
         R"(unknown key "levles" (did you mean "levels"?))"},
        {R"({"mesh": "cube.obj", "output": "c.etree", "help": true})", R"(unknown key "help")"},
        {R"({"mesh": "cube.obj", "output": "c.etree", "json": true})", R"(unknown key "json")"},
        {R"({"mesh": "cube.obj", "output": "c.etree", "levels": "2"})", R"("levels" must be a whole number)"},
        {R"({"mesh": "cube.obj", "output": "c.etree", "levels": 2.5})", R"("levels" must be a whole number)"},
        {R"({"mesh": "cube.obj", "output": "c.etree", "levels": -1})", R"("levels" must be a whole number)"},
        {R"({"mesh": "cube.obj", "output": "c.etree", "levels": 99999999999})", "levels"},
        {R"({"mesh": "cube.obj", "output": "c.etree", "alpha": true})", R"("alpha" must be a number)"},
        {R"({"mesh": "cube.obj", "output": "c.etree", "quality": 3})", R"("quality" must be a text)"},
        {R"({"mesh": "cube.obj", "output": "c.etree", "quality": "superb"})", "no such quality"},
        {R"({"mesh": "cube.obj", "output": "c.etree", "exact": 1})", R"("exact" must be true or false)"},
        {R"({"mesh": "cube.obj", "output": "c.etree", "degree": 1})", "degree must be 2 to 64"},
        {R"({"mesh": "cube.obj", "output": "c.etree", "levels": 2, "tolerance": 0.1})", "only one"},
        {R"({"mesh": "cube.obj", "output": "cube.obj"})", "the mesh of asset 1"},
        {R"({"mesh": "cube.obj", "output": "assets.json"})", "is the manifest"},
        {R"({"mesh": "cube.obj", "output": "-"})", "standard output"},
        {R"({"mesh": "cube.obj", "output": "nowhere/c.etree"})", "does not exist"},
        {R"({"mesh": "cube.obj"})", R"("output" is missing)"},
        {R"({"output": "c.etree"})", R"("mesh" is missing)"},
        {R"({"mesh": "", "output": "c.etree"})", R"("mesh" must not be empty)"},
        {R"({"mesh": null, "output": "c.etree"})", R"("mesh" must be a text)"},
        {R"(7)", "must be an object"},
    };
    std::string text;
    for (const auto& c : cases) text += (text.empty() ? "" : ",\n") + std::string(c.entry);
    const Outcome o = run({"bake", "--manifest", file("assets.json", "{\"assets\": [" + text + "]}"), "--json"});
    EXPECT_EQ(o.code, 1);
    const Json summary = Json::parse(o.out);
    EXPECT_EQ(summary["baked"], 1);
    EXPECT_EQ(summary["failed"], std::size(cases) - 1);
    for (size_t i = 0; i < std::size(cases); ++i) {
        SCOPED_TRACE(cases[i].entry);
        const Json& asset = summary["assets"][i];
        EXPECT_EQ(asset.contains("error"), cases[i].words != nullptr);
        if (!cases[i].words) continue;
        EXPECT_NE(asset.value("error", "").find(cases[i].words), std::string::npos) << asset;
        const std::string index = "prolate: asset " + std::to_string(i + 1) + " (";
        ASSERT_NE(o.err.find(index), std::string::npos) << o.err;
        const std::string line =
            o.err.substr(o.err.find(index), o.err.find('\n', o.err.find(index)) - o.err.find(index));
        EXPECT_NE(line.find(cases[i].words), std::string::npos) << line;
        EXPECT_NE(line.find("; "), std::string::npos) << "says what to do: " << line;
    }
    EXPECT_EQ(listing(), (std::vector<std::string>{"a.etree", "assets.json", "cube.obj"}));
}

TEST_F(Cli, ABadManifestIsRefusedAsAWhole) {
    const auto refuse = [this](const char* text, int code, const std::string& words) {
        SCOPED_TRACE(text);
        const std::string path = file("assets.json", text);
        expect_failure(run({"bake", "--manifest", path}), code, path, words);
    };
    refuse("", 3, "is not JSON");
    refuse(R"({"assets": [})", 3, "line 1");
    refuse(R"([])", 3, R"(must be an object with an array "assets")");
    refuse(R"({"assets": {}})", 3, R"(must be an object with an array "assets")");
    refuse(R"({"assets": [], "default": {}})", 3, R"(did you mean "defaults"?)");
    refuse(R"({"assets": [], "defaults": []})", 3, R"("defaults" must be an object)");
    refuse(R"({"assets": [], "defaults": {"levles": 1}})", 3, R"(defaults: unknown key "levles")");
    refuse(R"({"assets": [], "defaults": {"output": "a"}})", 3, R"("output" belongs to each asset)");
    const std::string empty = file("assets.json", R"({"assets": []})");
    EXPECT_EQ(run({"bake", "--manifest", empty}).code, 0);
    expect_failure(run({"bake", "--manifest", file("none.json")}), 4, file("none.json"), "No such file");
    expect_failure(run({"bake", "--manifest", empty, "--levels", "2"}), 2, "--levels", "in the manifest");
    expect_failure(run({"bake", shared("peanut.obj"), "--manifest", empty}), 2, "mesh", "in the manifest");
    expect_failure(run({"bake"}), 2, "bake", "no mesh");
}

TEST_F(Cli, CtrlCInAManifestKeepsWhatIsDone) {
    write(folder_ / "cube.obj", obj_text(cube()));
    write(folder_ / "large.obj", obj_text(peanut(60)));
    const std::string manifest = file("assets.json", R"({"assets": [
        {"mesh": "cube.obj", "output": "cube.etree", "levels": 1, "quality": "fast"},
        {"mesh": "large.obj", "output": "large.etree", "quality": "best", "ellipsoids": 20000},
        {"mesh": "cube.obj", "output": "last.etree", "levels": 1, "quality": "fast"}]})");
    RunOptions interrupt;
    interrupt.interrupt_when = [this] { return fs::exists(folder_ / "cube.etree"); };
    const Outcome o = run({"bake", "--manifest", manifest, "--json"}, interrupt);
    EXPECT_EQ(o.code, 130) << o.err;
    EXPECT_NE(o.err.find("2 of 3 assets not done"), std::string::npos) << o.err;
    EXPECT_EQ(listing(), (std::vector<std::string>{"assets.json", "cube.etree", "cube.obj", "large.obj"}));
    const Json summary = Json::parse(o.out);
    EXPECT_EQ(summary["baked"], 1);
    EXPECT_EQ(summary["not_done"], 2);
    EXPECT_NE(summary["assets"][2]["error"].get<std::string>().find("interrupted"), std::string::npos);
    EXPECT_EQ(run({"verify", file("cube.etree"), file("cube.obj")}).code, 0);
}

// ---- reading trees ----

TEST_F(Cli, BadTreesAreRefusedByEveryCommand) {
    const std::string good = read(shared("peanut.etree"));
    std::string newer = good, older = good, broken = good;
    newer[8] = 99;
    older[8] = 1;
    broken[broken.size() - 20] ^= 1;
    fs::create_directory(folder_ / "folder.etree");
    const struct {
        std::string path;
        int code;
        const char* words;
    } cases[] = {{file("missing.etree"), 4, "No such file"},
                 {file("folder.etree"), 4, "directory"},
                 {file("empty.etree", ""), 3, "empty"},
                 {file("foreign.etree", "this is not a tree"), 3, "not an .etree"},
                 {file("newer.etree", newer), 3, "newer format version than this library reads (version 99)"},
                 {file("older.etree", older), 3, "older format version than this library reads"},
                 {file("broken.etree", broken), 3, "prolate bake"},
                 {file("cut.etree", good.substr(0, good.size() - 1)), 3, "prolate bake"}};
    const auto before = listing();
    for (const auto& c : cases) {
        SCOPED_TRACE(c.path);
        expect_failure(run({"info", c.path}), c.code, c.path, c.words);
        expect_failure(run({"verify", c.path, shared("peanut.obj")}), c.code, c.path, c.words);
        expect_failure(run({"export", c.path, "-o", file("out.csv")}), c.code, c.path, c.words);
        expect_failure(run({"collide", shared("peanut.etree"), c.path}), c.code, c.path, c.words);
        expect_failure(run({"view", c.path, "-o", file("out.html")}), c.code, c.path, c.words);
    }
    EXPECT_EQ(listing(), before);
}

TEST_F(Cli, InfoTellsWhatIsThere) {
    const Outcome text = run({"info", shared("peanut.etree")});
    EXPECT_EQ(text.code, 0);
    EXPECT_NE(text.out.find("in 3 levels, degree 4; 6 blocks, "), std::string::npos) << text.out;
    const Json info = Json::parse(run({"info", shared("peanut.etree"), "--json"}).out);
    EXPECT_EQ(info["bytes"], fs::file_size(shared("peanut.etree")));
    EXPECT_EQ(info["asked"]["levels"], 2);
    EXPECT_EQ(info["levels"][2]["end_byte"], info["bytes"]);
    const Json report = Json::parse(read(shared("report.json")));
    EXPECT_EQ(info["source_hash"], report["source_hash"]);
    EXPECT_EQ(info["nodes"], report["nodes"]);
    EXPECT_EQ(info["bytes_per_node"], 256.0 * info["blocks"].get<double>() / info["nodes"].get<double>());
    EXPECT_EQ(info["levels"][1]["first_node"], 8);
    EXPECT_EQ(info["levels"][1]["blocks"], 1);
    for (size_t l = 0; l < 3; ++l)
        for (const auto& [key, value] : report["levels"][l].items())
            if (key != "seconds" && key != "nodes" && key != "bytes") {
                EXPECT_EQ(info["levels"][l][key], value) << key;
            }
    EXPECT_NE(text.out.find("+/-"), std::string::npos) << text.out;
    EXPECT_EQ(text.out.find("seconds"), std::string::npos) << "that is not in the file: " << text.out;

    const std::string whole = read(shared("peanut.etree"));
    const Outcome prefix = run({"info", file("prefix.etree", whole.substr(0, info["levels"][1]["end_byte"]))});
    EXPECT_EQ(prefix.code, 0) << prefix.err;
    EXPECT_NE(prefix.out.find("coarser tree"), std::string::npos) << prefix.out;
}

TEST_F(Cli, VerifySaysYesAndNo) {
    const Outcome yes = run({"verify", shared("peanut.etree"), shared("peanut.obj")});
    EXPECT_EQ(yes.code, 0) << yes.out;
    EXPECT_EQ(std::count(yes.err.begin(), yes.err.end(), '\n'), 1) << "the mesh's line alone:\n" << yes.err;
    EXPECT_NE(yes.out.find("level 2: covered"), std::string::npos) << yes.out;

    Mesh moved = peanut(8);
    for (Vec3& v : moved.vertices) v.x += 1;
    const std::string other = file("moved.obj", obj_text(moved));
    const Outcome no = run({"verify", shared("peanut.etree"), other});
    EXPECT_EQ(no.code, 1);
    EXPECT_NE(no.out.find("NOT covered"), std::string::npos) << no.out;
    EXPECT_NE(no.err.find("baked from another mesh"), std::string::npos) << no.err;
    const Outcome json = run({"verify", shared("peanut.etree"), other, "--json"});
    EXPECT_EQ(json.code, 1);
    const Json report = Json::parse(json.out);
    EXPECT_FALSE(report["covered"]);
    EXPECT_FALSE(report["baked_from_this_mesh"]);
    EXPECT_EQ(report["levels"][0]["counterexample"].size(), 3u);
    EXPECT_EQ(run({"verify", shared("peanut.etree"), file("missing.obj")}).code, 4);
}

// ---- where the mesh stands ----

TEST_F(Cli, UnitsScalesAndOriginsNeedNoSecondTelling) {
    const std::string mesh = file("cube.obj", obj_text(cube()));
    const auto bake = [&](const std::vector<std::string>& options) {
        std::vector<std::string> words = {"bake", mesh, "-o", file("a.etree"), "--exact", "--rebake"};
        words.insert(words.end(), options.begin(), options.end());
        return run(words);
    };
    struct Case {
        std::vector<std::string> options;
        const char* box;
        std::array<double, 3> scale;
    };
    for (const Case& c :
         {Case{{"--unit", "mm"}, "box 0.002 x 0.002 x 0.002 m", {0.001, 0.001, 0.001}},
          Case{{"--scale", "2"}, "box 4 x 4 x 4 m", {2, 2, 2}},
          Case{{"--scale", "1,-3,0.5", "--unit", "in"}, "box 0.0508 x 0.1524 x 0.0254 m", {0.0254, -0.0762, 0.0127}}}) {
        const Outcome baked = bake(c.options);
        EXPECT_EQ(baked.code, 0) << baked.err;
        EXPECT_NE(baked.err.find(c.box), std::string::npos) << baked.err;
        EXPECT_EQ(baked.err.find("inside out"), std::string::npos) << "mirrored faces are turned: " << baked.err;
        const Json info = Json::parse(run({"info", file("a.etree"), "--json"}).out);
        for (size_t k = 0; k < 3; ++k) EXPECT_NEAR(info["scale"][k].get<double>(), c.scale[k], 1e-12);
        const Outcome verified = run({"verify", file("a.etree"), mesh});
        EXPECT_EQ(verified.code, 0) << verified.out << verified.err;
        EXPECT_NE(verified.err.find(c.box), std::string::npos) << verified.err;
        EXPECT_EQ(run({"verify", file("a.etree"), mesh, "--scale", "7"}).code, 1) << "it may be told otherwise";
    }
    for (const std::vector<std::string>& wrong :
         {std::vector<std::string>{"--unit", "furlong"}, {"--scale", "0"}, {"--scale", "1,2"}, {"--weld", "-1"}})
        EXPECT_EQ(bake(wrong).code, 2) << wrong[1];

    Mesh far = cube();
    std::ostringstream text;
    text.precision(17);
    for (const Vec3& v : far.vertices) text << "v " << v.x + 500000.25 << ' ' << v.y + 5400000.0 << ' ' << v.z << '\n';
    const std::string shape = obj_text(far);
    text << shape.substr(shape.find("f "));
    write(mesh, text.str());
    const Outcome refused = bake({});
    EXPECT_EQ(refused.code, 3);
    EXPECT_NE(refused.err.find("--recentre"), std::string::npos) << refused.err;
    EXPECT_EQ(bake({"--recentre"}).code, 0);
    const Json info = Json::parse(run({"info", file("a.etree"), "--json"}).out);
    EXPECT_NEAR(info["origin"][0].get<double>(), 500000, 1);
    EXPECT_NEAR(info["origin"][1].get<double>(), 5400000, 1);
    EXPECT_NE(run({"info", file("a.etree")}).out.find("origin"), std::string::npos);
    EXPECT_EQ(run({"verify", file("a.etree"), mesh}).code, 0);

    write(mesh, obj_text(cube()));
    const std::string manifest = file("assets.json", R"({"defaults": {"exact": true}, "assets": [
        {"mesh": "cube.obj", "output": "one.etree", "unit": "cm"},
        {"mesh": "cube.obj", "output": "two.etree", "scale": [1, 1, -2], "recentre": true},
        {"mesh": "cube.obj", "output": "three.etree", "scale": 0.5, "weld": 0}]})");
    EXPECT_EQ(run({"bake", "--manifest", manifest, "--cache", file("cache")}).code, 0);
    const double expected[][3] = {{0.01, 0.01, 0.01}, {1, 1, -2}, {0.5, 0.5, 0.5}};
    const char* const names[] = {"one.etree", "two.etree", "three.etree"};
    for (size_t i = 0; i < 3; ++i) {
        const Json one = Json::parse(run({"info", file(names[i]), "--json"}).out);
        for (size_t k = 0; k < 3; ++k) EXPECT_EQ(one["scale"][k], expected[i][k]) << names[i];
        EXPECT_EQ(run({"verify", file(names[i]), mesh}).code, 0);
    }
}

std::string fmt_vertex(float x, float y, float z) {
    std::ostringstream out;
    out.precision(9);
    out << "v " << x << ' ' << y << ' ' << z << '\n';
    return out.str();
}

TEST_F(Cli, WhatWasDoneToAMeshIsTold) {
    Mesh turned = cube();
    for (Triangle& t : turned.triangles) std::swap(t[0], t[1]);
    const Outcome inside_out = run({"bake", file("turned.obj", obj_text(turned)), "-o", file("a.etree"), "--exact"});
    EXPECT_EQ(inside_out.code, 0);
    EXPECT_NE(inside_out.err.find("1 closed part was inside out"), std::string::npos) << inside_out.err;
    std::string loose; // each triangle with corners of its own, one of them a little off
    const Mesh whole = cube();
    for (size_t t = 0; t < whole.triangles.size(); ++t)
        for (size_t c = 0; c < 3; ++c) {
            const Vec3& v = whole.vertices[whole.triangles[t][c]];
            loose += fmt_vertex(v.x + (t == 0 && c == 0 ? 6e-8f : 0), v.y, v.z);
        }
    for (size_t t = 0; t < whole.triangles.size(); ++t)
        loose +=
            "f " + std::to_string(3 * t + 1) + " " + std::to_string(3 * t + 2) + " " + std::to_string(3 * t + 3) + "\n";
    const std::string mesh = file("loose.obj", loose);
    const Outcome joined = run({"bake", mesh, "-o", file("b.etree"), "--quality", "fast", "--ellipsoids", "2"});
    EXPECT_EQ(joined.code, 0) << joined.err;
    EXPECT_NE(joined.err.find("12 triangles on 8 distinct vertices"), std::string::npos) << joined.err;
    EXPECT_NE(joined.err.find("1 vertices joined"), std::string::npos) << joined.err;
    EXPECT_EQ(run({"verify", file("b.etree"), mesh}).code, 0);
    EXPECT_NE(joined.err.find("covered as it was before, too"), std::string::npos) << joined.err;
    const Outcome exact = run({"bake", mesh, "-o", file("e.etree"), "--exact"});
    EXPECT_NE(exact.err.find("answers are for the joined mesh"), std::string::npos) << exact.err;
    const Outcome info = run({"info", file("e.etree")});
    EXPECT_NE(info.out.find("corners up to 9.5e-07 m apart may be one"), std::string::npos) << info.out;
    const Outcome apart = run({"bake", mesh, "-o", file("c.etree"), "--exact", "--weld", "0"});
    EXPECT_NE(apart.err.find("surface mode"), std::string::npos) << apart.err;
    const Outcome large =
        run({"bake", file("large.obj", "v 0 0 0\nv 1e25 0 0\nv 0 1e25 0\nf 1 2 3\n"), "-o", file("d.etree")});
    EXPECT_EQ(large.code, 3);
    EXPECT_NE(large.err.find("another unit"), std::string::npos) << large.err;
    EXPECT_EQ(std::count(large.err.begin(), large.err.end(), '\n'), 1) << large.err;
}

// ---- export ----

std::vector<std::vector<double>> parse_csv(const std::string& text) {
    std::istringstream lines(text);
    std::string line;
    std::getline(lines, line);
    EXPECT_EQ(line, "level,cx,cy,cz,r1,r2,r3,R11,R12,R13,R21,R22,R23,R31,R32,R33");
    std::vector<std::vector<double>> rows;
    while (std::getline(lines, line)) {
        rows.emplace_back();
        std::istringstream cells(line);
        for (std::string cell; std::getline(cells, cell, ',');) rows.back().push_back(std::stod(cell));
        EXPECT_EQ(rows.back().size(), 16u);
    }
    return rows;
}

TEST_F(Cli, CsvAgreesWithInfoAndCovers) {
    const Json info = Json::parse(run({"info", shared("peanut.etree"), "--json"}).out);
    const Outcome all = run({"export", shared("peanut.etree"), "-o", "-", "--format", "csv"});
    ASSERT_EQ(all.code, 0) << all.err;
    EXPECT_EQ(all.err, "");
    std::map<double, size_t> counts;
    for (const auto& row : parse_csv(all.out)) ++counts[row[0]];
    ASSERT_EQ(counts.size(), info["levels"].size());
    const Mesh mesh = peanut(8);
    for (size_t l = 0; l < counts.size(); ++l) {
        EXPECT_EQ(counts[static_cast<double>(l)], info["levels"][l]["cut"]);
        const std::string path = file("level" + std::to_string(l) + ".csv");
        ASSERT_EQ(run({"export", shared("peanut.etree"), "-o", path, "--level", std::to_string(l)}).code, 0);
        const auto rows = parse_csv(read(path));
        EXPECT_EQ(rows.size(), info["levels"][l]["cut"]);
        // The columns mean what they say: every vertex of the mesh lies in an ellipsoid made from them.
        for (const Vec3& v : mesh.vertices) {
            double nearest = INFINITY;
            for (const auto& row : rows) {
                EXPECT_EQ(row[0], static_cast<double>(l));
                const double d[3] = {v.x - row[1], v.y - row[2], v.z - row[3]};
                double sum = 0;
                for (size_t i = 0; i < 3; ++i)
                    sum += std::pow((row[7 + i] * d[0] + row[10 + i] * d[1] + row[13 + i] * d[2]) / row[4 + i], 2);
                nearest = std::min(nearest, sum);
            }
            EXPECT_LE(nearest, 1 + 1e-9);
        }
    }
    expect_failure(run({"export", shared("peanut.etree"), "-o", file("x.csv"), "--level", "3"}), 2, "--level",
                   "no level 3");
}

TEST_F(Cli, ExportsJsonAndPictures) {
    const Json info = Json::parse(run({"info", shared("peanut.etree"), "--json"}).out);
    ASSERT_EQ(run({"export", shared("peanut.etree"), "-o", file("a.json")}).code, 0);
    const Json json = Json::parse(read(file("a.json")));
    EXPECT_EQ(json["nodes"].size(), info["nodes"]);
    EXPECT_EQ(json["nodes"][0]["factor"].size(), 6u);
    // Children are named as the nodes are: by slots, which have gaps.
    std::set<uint32_t> names, children{0};
    for (const Json& node : json["nodes"]) {
        names.insert(node["node"].get<uint32_t>());
        for (uint32_t i = 0; i < node["child_count"].get<uint32_t>(); ++i)
            children.insert(node["first_child"].get<uint32_t>() + i);
    }
    EXPECT_EQ(names.size(), info["nodes"]);
    EXPECT_EQ(names, children);
    EXPECT_GT(*names.rbegin(), names.size());

    ASSERT_EQ(run({"export", shared("peanut.etree"), "-o", file("a.PLY"), "--level", "1"}).code, 0);
    const auto mesh = load_mesh(file("a.PLY").c_str());
    ASSERT_TRUE(mesh) << mesh.error().what;
    const auto cleaned = clean(mesh->view());
    ASSERT_TRUE(cleaned);
    EXPECT_TRUE(cleaned->report.closed);
    EXPECT_EQ(mesh->triangles.size(), 512u * info["levels"][1]["cut"].get<size_t>());
    const std::string bytes = read(file("a.PLY"));
    EXPECT_NE(bytes.find("property uchar red"), std::string::npos);

    // Every format through the command, into a file and into a pipe, with what a level has.
    const size_t cut = info["levels"][1]["cut"];
    for (const auto& [format, mark] : {std::pair{"obj", "\n# node_"}, {"glb", "\"mesh\":"}, {"pov", "  sphere {"}}) {
        SCOPED_TRACE(format);
        const std::string path = file(std::string("a.") + format);
        ASSERT_EQ(run({"export", shared("peanut.etree"), "-o", path, "--level", "1"}).code, 0);
        const std::string content = read(path);
        size_t count = 0;
        for (size_t at = content.find(mark); at != std::string::npos; at = content.find(mark, at + 1)) ++count;
        EXPECT_EQ(count, cut);
        const Outcome piped = run({"export", shared("peanut.etree"), "-o", "-", "--format", format, "--level", "1"});
        EXPECT_EQ(piped.out, content);
        EXPECT_EQ(piped.err, "");
    }
    // What is meant for collision lies outside the ellipsoids, what is looked at does not, unless otherwise told.
    for (const char* format : {"ply", "obj", "glb"}) {
        const auto exported = [&](const char* flag) {
            const Outcome outcome = run({"export", shared("peanut.etree"), "-o", "-", "--format", format, flag});
            EXPECT_EQ(outcome.code, 0) << outcome.err;
            return outcome.out;
        };
        EXPECT_NE(exported("--outer"), exported("--no-outer"));
        EXPECT_EQ(exported("--segments=32"), exported(format == std::string("glb") ? "--no-outer" : "--outer"));
    }
    ASSERT_EQ(run({"export", shared("peanut.etree"), "-o", file("fine.ply"), "--level", "1", "--segments", "64"}).code,
              0);
    const auto fine = load_mesh(file("fine.ply").c_str());
    ASSERT_TRUE(fine);
    EXPECT_EQ(fine->triangles.size(), 4 * mesh->triangles.size());
    EXPECT_NE(read(file("a.pov")),
              run({"export", shared("peanut.etree"), "-o", "-", "--format", "pov", "--level", "1", "--up", "-z"}).out);
    expect_failure(run({"export", shared("peanut.etree"), "-o", file("b.obj"), "--segments", "2"}), 2, "export",
                   "--segments");
    expect_failure(run({"export", shared("peanut.etree"), "-o", file("noname")}), 2, file("noname"), "--format");
    expect_failure(run({"export", shared("peanut.etree"), "-o", "-"}), 2, "-", "--format");
    expect_failure(run({"export", shared("peanut.etree"), "-o", file("a.doc")}), 2, "doc", "no such export format");
}

// ---- collide ----

TEST_F(Cli, CollideAnswersForBothVerdicts) {
    const std::string tree = shared("peanut.etree");
    const Outcome apart = run({"collide", tree, tree, "--pose", "0,0,-9"});
    EXPECT_EQ(apart.code, 0) << apart.err;
    EXPECT_TRUE(apart.out.starts_with("separated\n")) << apart.out;
    const Outcome meeting = run({"collide", tree, tree, "--pose", "-0.5,0,0,0,0,0.7071,0.7071", "--json"});
    EXPECT_EQ(meeting.code, 0) << meeting.err;
    const Json json = Json::parse(meeting.out);
    EXPECT_EQ(json["verdict"], "overlapping");
    EXPECT_TRUE(json["node_a"].is_number() && json["node_b"].is_number());
    EXPECT_GT(json["pair_tests"], 0);
    // The rotation counts: two long bodies side by side, and one of them turned by a right angle about z.
    EXPECT_TRUE(run({"collide", tree, tree, "--pose", "0,2.2,0"}).out.starts_with("separated"));
    EXPECT_TRUE(run({"collide", tree, tree, "--pose", "0,2.2,0,0,0,1,1"}).out.starts_with("overlapping"));
    EXPECT_TRUE(run({"collide", tree, tree, "--budget", "0"}).out.starts_with("undecided"));
    EXPECT_EQ(Json::parse(run({"collide", tree, tree, "--level", "0", "--json"}).out)["deepest_level"], 0);
}

TEST_F(Cli, CollideRefusesBadPoses) {
    const std::string tree = shared("peanut.etree");
    for (const char* pose : {"", "1,2", "1,2,3,4", "1,2,3,0,0,0,0", "1,2,nan", "1,2,3,", "1,2,x", "1 2 3",
                             "1,2,3,0,0,0,1,5", "1,2,1e99"}) {
        SCOPED_TRACE(pose);
        expect_failure(run({"collide", tree, tree, "--pose=" + std::string(pose)}), 2, *pose ? "--pose" : "collide",
                       "");
    }
}

// ---- view ---- (tests/viewer looks at pages with a browser)

// The JSON of a page's scene.
Json scene_of(const std::string& page) {
    const std::string begin = "<script id=\"scene\" type=\"application/json\">";
    const size_t at = page.find(begin) + begin.size();
    return Json::parse(page.substr(at, page.find("</script>", at) - at));
}

TEST_F(Cli, ViewMakesAPageOfItsOwn) {
    const std::string tree = file("a<b>&\"'.etree", read(shared("peanut.etree")));
    const Outcome o = run({"view", tree, shared("peanut.obj"), "-o", file("page.html")});
    ASSERT_EQ(o.code, 0) << o.err;
    EXPECT_EQ(o.out + o.err, "");
    const std::string page = read(file("page.html"));
    EXPECT_TRUE(page.starts_with("<!DOCTYPE html>"));
    EXPECT_NE(page.find("default-src 'none'"), std::string::npos);
    for (const char* reference : {"http:", "https:", "src=\"", "<link rel=\"stylesheet", "@import", "a<b>&"})
        EXPECT_EQ(page.find(reference), std::string::npos) << reference;
    EXPECT_LT(page.size(), 3'000'000u);
    const Json scene = scene_of(page), &body = scene["bodies"][0];
    EXPECT_EQ(body["tree"], "a<b>&\"'.etree");
    EXPECT_EQ(body["levels"].size(), 3u);
    EXPECT_EQ(body["nodes"]["slot"]["count"], Json::parse(run({"info", tree, "--json"}).out)["nodes"]);
    EXPECT_EQ(body["mesh"]["triangles"]["count"], 3 * 768);
    EXPECT_GT(body["lattice"]["distance"]["count"], 100'000);
    EXPECT_TRUE(body["nodes"].contains("sub_volume"));

    const Outcome piped = run({"view", tree, "-o", "-", "--up", "-z"});
    ASSERT_EQ(piped.code, 0) << piped.err;
    const Json alone = scene_of(piped.out);
    EXPECT_EQ(alone["up"], "-z");
    EXPECT_FALSE(alone["bodies"][0].contains("mesh") || alone["bodies"][0]["nodes"].contains("sub_volume"));

    const Outcome other = run({"view", tree, file("cube.obj", obj_text(cube())), "-o", "-"});
    EXPECT_EQ(other.code, 0);
    EXPECT_NE(other.err.find("not the mesh"), std::string::npos) << other.err;
}

TEST_F(Cli, ViewTellsWhatItCannotDo) {
    const std::string tree = shared("peanut.etree"), mesh = shared("peanut.obj"), out = file("page.html");
    expect_failure(run({"view", tree, "-o", file("page.png")}), 2, file("page.png"), ".html");
    expect_failure(run({"view", mesh, tree, "-o", out}), 2, "view", "a mesh must follow");
    expect_failure(run({"view", tree, mesh, mesh, "-o", out}), 2, "view", "a mesh must follow");
    expect_failure(run({"view", tree, tree, tree, "-o", out}), 2, "view", "3 trees are too many");
    expect_failure(run({"view", tree, "--pose", "1,2,3", "-o", out}), 2, "--pose", "no second body");
    expect_failure(run({"view", tree, tree, "--pose", "1,2", "-o", out}), 2, "--pose", "three or seven");
    expect_failure(run({"view", tree, "--up", "w", "-o", out}), 2, "view", "--up");
    expect_failure(run({"view", tree, "-o", file("nowhere/page.html")}), 4, file("nowhere/page.html"),
                   "does not exist");
    EXPECT_TRUE(listing().empty());
    // Two trees need the runtime in the page; without emscripten, the command says so.
    const Outcome two = run({"view", tree, mesh, tree, "--pose", "1,2,3", "-o", out});
    if (two.code != 0) return expect_failure(two, 2, "view", "built without emscripten");
    const Json scene = scene_of(read(out));
    EXPECT_EQ(scene["pose"], (Json{1, 2, 3, 0, 0, 0, 1}));
    EXPECT_EQ(scene["bodies"][1]["file"]["count"], fs::file_size(tree));
}

// ---- help ----

TEST_F(Cli, HelpTeachesWithExamples) {
    const Outcome help = run({"--help"});
    EXPECT_EQ(help.code, 0);
    EXPECT_NE(help.out.find("Exit codes"), std::string::npos);
    for (const char* command : {"bake", "info", "verify", "export", "collide", "render", "view"}) {
        EXPECT_NE(help.out.find(command), std::string::npos);
        const Outcome one = run({command, "--help"});
        EXPECT_EQ(one.code, 0);
        EXPECT_NE(one.out.find(std::string("prolate ") + command), std::string::npos) << one.out;
    }
    const Outcome version = run({"--version"});
    EXPECT_EQ(version.code, 0);
    EXPECT_TRUE(version.out.starts_with("prolate ")) << version.out;
}

} // namespace
} // namespace prolate
