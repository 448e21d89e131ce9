// Bakes, proofs and imports. They take long, so they work on a thread of their own, while the caller's thread looks for
// Ctrl-C and calls the caller's progress function.
#include "python/src/tree.hpp"

#include <prolate/build.hpp>
#include <prolate/modes.hpp>
#include <prolate/rig.hpp>
#include <prolate/verify.hpp>

#include <chrono>
#include <condition_variable>
#include <cstring>
#include <mutex>
#include <optional>
#include <thread>

namespace prolate::python {
namespace {

// How far the work is, as its thread says.
class Progress {
public:
    /// Called by the work; false: stop.
    bool report(const char* stage, double fraction, uint32_t nodes) {
        const std::lock_guard lock(mutex_);
        stage_ = stage, fraction_ = fraction, nodes_ = nodes;
        return !stop_;
    }
    bool go_on() {
        const std::lock_guard lock(mutex_);
        return !stop_;
    }

    /// Runs `work` on a thread of its own. `callback` is None or called as callback(stage, fraction, nodes) ten times a
    /// second; False stops the work. Throws what the callback or a signal's handler raises, once the work has ended.
    template <class Work> auto run(nb::handle callback, Work&& work) {
        std::optional<decltype(work())> result;
        std::exception_ptr failed;
        bool done = false;
        std::optional<nb::gil_scoped_release> released(std::in_place);
        std::thread worker([&] {
            try {
                result.emplace(work());
            } catch (...) {
                failed = std::current_exception();
            }
            const std::lock_guard lock(mutex_);
            done = true;
            ended_.notify_all();
        });
        std::exception_ptr raised;
        std::unique_lock lock(mutex_);
        while (!ended_.wait_for(lock, std::chrono::milliseconds(100), [&] { return done; })) {
            const char* const stage = stage_;
            const double fraction = fraction_;
            const uint32_t nodes = nodes_;
            lock.unlock();
            released.reset();
            if (!raised) raised = tell(callback, stage, fraction, nodes);
            released.emplace();
            lock.lock();
            if (raised) stop_ = true;
        }
        lock.unlock();
        worker.join();
        released.reset();
        if (!raised && !failed) raised = tell(callback, "done", 1, nodes_);
        if (raised) std::rethrow_exception(raised);
        if (failed) std::rethrow_exception(failed);
        return std::move(*result);
    }

private:
    static std::exception_ptr tell(nb::handle callback, const char* stage, double fraction, uint32_t nodes) {
        try {
            if (PyErr_CheckSignals() != 0) throw nb::python_error();
            if (callback.is_none()) return {};
            if (callback(stage, fraction, nodes).is(nb::borrow(Py_False)))
                throw Failure{{ErrorCode::cancelled, "the progress function returned False"}, ""};
        } catch (...) {
            return std::current_exception();
        }
        return {};
    }

    std::mutex mutex_;
    std::condition_variable ended_;
    bool stop_ = false;
    const char* stage_ = "";
    double fraction_ = 0;
    uint32_t nodes_ = 0;
};

// A mesh over the caller's arrays, if these are float32 and (u)int32, contiguous; else over copies.
struct TakenMesh {
    MeshView view;
    nb::object keep[2];
    std::vector<Vec3> vertices;
};

std::span<const Triangle> take_faces(nb::handle faces, nb::object& keep) {
    AnyArray array = import_array(faces);
    keep = nb::borrow(faces);
    const auto is_index = [](const AnyArray& a) {
        return a.dtype() == nb::dtype<uint32_t>() || a.dtype() == nb::dtype<int32_t>();
    };
    if (!array.is_valid() || !is_index(array) || !array.is_contiguous()) {
        // Other integers are copied, in 64 bits first, so that none comes out as another.
        if (array.is_valid() && array.dtype().code != static_cast<uint8_t>(nb::dlpack::dtype_code::Int) &&
            array.dtype().code != static_cast<uint8_t>(nb::dlpack::dtype_code::UInt))
            type_error("faces", "must be an array of integers");
        const nb::object wide = as_numpy(faces, "faces", "int64");
        const AnyArray checked = import_array(wide);
        const auto* index = static_cast<const int64_t*>(checked.data());
        const size_t columns = checked.ndim() == 2 && checked.shape(1) > 0 ? checked.shape(1) : 1;
        for (size_t i = 0; i < checked.size(); ++i)
            if (index[i] < 0 || index[i] > UINT32_MAX)
                value_error("faces[" + std::to_string(i / columns) + "]",
                            "has the index " + std::to_string(index[i]) + ", which is no vertex");
        keep = as_numpy(wide, "faces", "uint32");
        array = import_array(keep);
    }
    if (array.ndim() != 2 || array.shape(1) != 3)
        value_error("faces",
                    "must have shape (M, 3), not " + array.shape_text() + "; cut polygons into triangles first");
    return {static_cast<const Triangle*>(array.data()), array.shape(0)};
}

void check_faces(std::span<const Triangle> faces, size_t vertices) {
    for (size_t i = 0; i < faces.size(); ++i)
        for (const uint32_t v : faces[i])
            if (v >= vertices)
                value_error("faces[" + std::to_string(i) + "]",
                            "has the index " + std::to_string(static_cast<int32_t>(v)) + "; there are " +
                                std::to_string(vertices) + " vertices");
}

TakenMesh take_mesh(nb::handle vertices, nb::handle faces, nb::handle placement) {
    TakenMesh out;
    AnyArray array = import_array(vertices);
    out.keep[0] = nb::borrow(vertices);
    if (!array.is_valid() || array.dtype() != nb::dtype<float>() || !array.is_contiguous()) {
        out.keep[0] = as_numpy(vertices, "vertices", "float64");
        const AnyArray wide = import_array(out.keep[0]);
        const auto* from = static_cast<const double*>(wide.data());
        if (wide.ndim() == 2 && wide.shape(1) == 3)
            for (size_t i = 0; i < wide.shape(0); ++i)
                out.vertices.push_back({static_cast<float>(from[3 * i]), static_cast<float>(from[3 * i + 1]),
                                        static_cast<float>(from[3 * i + 2])});
        array = wide;
    }
    if (array.ndim() != 2 || array.shape(1) != 3)
        value_error("vertices", "must have shape (N, 3), not " + array.shape_text());
    const std::span<const Vec3> points = out.vertices.empty()
                                             ? std::span(static_cast<const Vec3*>(array.data()), array.shape(0))
                                             : std::span<const Vec3>(out.vertices);
    for (size_t i = 0; i < points.size(); ++i)
        if (!std::isfinite(points[i].x + points[i].y + points[i].z))
            value_error("vertices[" + std::to_string(i) + "]", "is not finite, or beyond the range of float32");
    const std::span<const Triangle> triangles = take_faces(faces, out.keep[1]);
    check_faces(triangles, points.size());
    out.view = {points, triangles, {}};
    if (!placement.is_none()) {
        const nb::tuple both = nb::cast<nb::tuple>(placement);
        for (size_t k = 0; k < 3; ++k) {
            out.view.placement.scale[k] = nb::cast<double>(both[0][k]);
            out.view.placement.origin[k] = nb::cast<double>(both[1][k]);
        }
    }
    return out;
}

template <class Enum>
Enum choice(nb::handle value, const char* name, std::initializer_list<std::pair<const char*, Enum>> words) {
    std::string given, known;
    if (PyUnicode_Check(value.ptr())) given = nb::cast<const char*>(value);
    for (const auto& [word, meaning] : words) {
        if (given == word) return meaning;
        known += (known.empty() ? "\"" : ", \"") + std::string(word) + "\"";
    }
    value_error(name, "must be one of " + known);
}

Quality quality_of(nb::handle value) {
    return choice<Quality>(value, "quality",
                           {{"fast", Quality::fast}, {"normal", Quality::normal}, {"best", Quality::best}});
}

// Of the keyword arguments of prolate.bake(), which has the default values.
BuildOptions options_of(const nb::dict& o) {
    BuildOptions out;
    const auto above_0 = [&](const char* name) { // 0: not asked
        if (o[name].is_none()) return 0.0f;
        const double value = number(o[name], name);
        if (!(value > 0)) value_error(name, "must be above 0");
        return static_cast<float>(value);
    };
    out.degree = static_cast<uint32_t>(whole(o["degree"], "degree", 2, kMaxDegree));
    out.levels = static_cast<uint32_t>(whole_or(o["levels"], "levels", 1, kMaxLevels - 1, 0));
    out.ellipsoids = static_cast<uint32_t>(whole_or(o["ellipsoids"], "ellipsoids", 1, 65536, 0));
    out.tolerance = above_0("tolerance");
    out.distance = above_0("distance");
    out.clearance = above_0("clearance");
    out.keep_holes = above_0("keep_holes");
    out.fill = above_0("fill");
    out.exact = nb::cast<bool>(o["exact"]);
    out.inner = static_cast<uint32_t>(whole_or(o["inner"], "inner", 1, 65536, 0));
    out.leaf_triangles = static_cast<uint32_t>(whole(o["leaf_triangles"], "leaf_triangles", 1, kMaxLeafTriangles));
    out.primitive = choice<Primitive>(o["primitive"], "primitive",
                                      {{"ellipsoid", Primitive::ellipsoid}, {"sphere", Primitive::sphere}});
    out.quality = quality_of(o["quality"]);
    out.method = choice<Method>(o["method"], "method", {{"voxel", Method::voxel}, {"analytic", Method::analytic}});
    out.alpha = static_cast<float>(number_from_0(o["alpha"], "alpha"));
    out.beta = static_cast<float>(number_from_0(o["beta"], "beta"));
    out.weld = o["weld"].is_none() ? kDefaultWeld : static_cast<float>(number_from_0(o["weld"], "weld"));
    out.seed = whole(o["seed"], "seed", 0, UINT64_MAX);
    out.threads = static_cast<uint32_t>(whole(o["threads"], "threads", 0, 1024));
    if (const auto valid = validate(out); !valid) throw nb::value_error(valid.error().what);
    return out;
}

nb::dict report_dict(const MeshReport& r) {
    nb::dict out;
    out["input_vertices"] = r.input_vertices;
    out["input_triangles"] = r.input_triangles;
    out["merged_vertices"] = r.merged_vertices;
    out["unused_vertices"] = r.unused_vertices;
    out["welded_vertices"] = r.welded_vertices;
    out["weld_distance"] = r.weld_distance;
    out["degenerate_triangles"] = r.degenerate_triangles;
    out["open_edges"] = r.open_edges;
    out["non_manifold_edges"] = r.non_manifold_edges;
    out["closed"] = r.closed;
    out["turned_shells"] = r.turned_shells;
    out["size"] = nb::make_tuple(r.size[0], r.size[1], r.size[2]);
    return out;
}

std::string about(const Error& error) { // which vertex or triangle
    const std::string_view what = error.what;
    if (what.starts_with("vertex") || what.starts_with("triangle")) return "index " + std::to_string(error.where);
    return "";
}

// (bytes, report)
nb::tuple bake(nb::handle vertices, nb::handle faces, nb::handle placement, const nb::dict& options,
               nb::handle callback) {
    const BuildOptions wanted = options_of(options);
    const TakenMesh mesh = take_mesh(vertices, faces, placement);
    Progress progress;
    const auto built = progress.run(callback, [&] {
        return build(mesh.view, wanted,
                     [&](const BuildProgress& p) { return progress.report(p.stage, p.fraction, p.nodes); });
    });
    if (!built && built.error().code == ErrorCode::bad_options) throw nb::value_error(built.error().what);
    if (!built) throw Failure{built.error(), about(built.error())};
    nb::dict report = report_dict(built->mesh);
    report["hole_radius"] = wanted.keep_holes > 0 ? nb::cast(built->hole_radius) : nb::none();
    return nb::make_tuple(owned_bytes(built->tree.bytes()), report);
}

// Bytes of the tree with its deformation.
nb::object add_modes_to(nb::handle tree, nb::handle vertices, nb::handle faces, nb::handle placement, nb::handle modes,
                        nb::handle ranges) {
    const HeldTree& held = tree_of(tree, "tree");
    const TakenMesh mesh = take_mesh(vertices, faces, placement);
    const nb::object keep[2] = {as_numpy(modes, "modes", "float64"), as_numpy(ranges, "ranges", "float64")};
    const AnyArray of_modes = import_array(keep[0]), of_ranges = import_array(keep[1]);
    if (of_modes.ndim() != 3 || of_modes.shape(1) != mesh.view.vertices.size() || of_modes.shape(2) != 3)
        value_error("modes", "must have shape (M, " + std::to_string(mesh.view.vertices.size()) + ", 3), not " +
                                 of_modes.shape_text());
    if (of_ranges.ndim() != 1 || of_ranges.shape(0) != of_modes.shape(0))
        value_error("ranges",
                    "must have shape (" + std::to_string(of_modes.shape(0)) + ",), not " + of_ranges.shape_text());
    const auto floats = [](const AnyArray& array) {
        const auto* const from = static_cast<const double*>(array.data());
        std::vector<float> out;
        for (size_t i = 0; i < array.size(); ++i) out.push_back(static_cast<float>(from[i]));
        return out;
    };
    const std::vector<float> displacements = floats(of_modes), most = floats(of_ranges);
    const Modes given{displacements, most};
    Progress progress;
    const auto added = progress.run(nb::none(), [&] { return add_modes(held.view, mesh.view, given); });
    if (!added && added.error().code == ErrorCode::bad_options) throw nb::value_error(added.error().what);
    if (!added) throw Failure{added.error(), "index " + std::to_string(added.error().where)};
    return owned_bytes(added->bytes());
}

// Bytes of the tree with its skin. `joints` are whole numbers below kMaxBones.
nb::object add_skin_to(nb::handle tree, nb::handle vertices, nb::handle faces, nb::handle placement, nb::handle joints,
                       nb::handle weights, nb::handle bones) {
    const HeldTree& held = tree_of(tree, "tree");
    const TakenMesh mesh = take_mesh(vertices, faces, placement);
    const nb::object keep[2] = {as_numpy(joints, "joints", "float64"), as_numpy(weights, "weights", "float64")};
    const AnyArray which = import_array(keep[0]), much = import_array(keep[1]);
    std::vector<uint16_t> indices;
    std::vector<float> parts;
    for (size_t i = 0; i < which.size(); ++i)
        indices.push_back(static_cast<uint16_t>(static_cast<const double*>(which.data())[i])),
            parts.push_back(static_cast<float>(static_cast<const double*>(much.data())[i]));
    const BoneWeights given{static_cast<uint32_t>(whole(bones, "bones", 1, kMaxBones)),
                            static_cast<uint32_t>(which.shape(1)), indices, parts};
    Progress progress;
    const auto added = progress.run(nb::none(), [&] { return add_skin(held.view, mesh.view, given); });
    if (!added && added.error().code == ErrorCode::bad_options) throw nb::value_error(added.error().what);
    if (!added) throw Failure{added.error(), "index " + std::to_string(added.error().where)};
    return owned_bytes(added->bytes());
}

// (source hash, options hash), the key of a cache.
nb::tuple bake_key(nb::handle vertices, nb::handle faces, nb::handle placement, const nb::dict& options) {
    const BuildOptions wanted = options_of(options);
    const TakenMesh mesh = take_mesh(vertices, faces, placement);
    Progress progress;
    const auto cleaned =
        progress.run(nb::none(), [&] { return clean(mesh.view, wanted.weld, [&] { return progress.go_on(); }); });
    if (!cleaned) throw Failure{cleaned.error(), about(cleaned.error())};
    return nb::make_tuple(hash(cleaned->mesh.view()), hash(wanted));
}

nb::dict verify_tree(nb::handle tree, nb::handle vertices, nb::handle faces, nb::handle placement, nb::handle threads,
                     nb::handle callback) {
    const HeldTree& held = tree_of(tree, "tree");
    const TakenMesh mesh = take_mesh(vertices, faces, placement);
    Progress progress;
    VerifyOptions options{.threads = static_cast<uint32_t>(whole(threads, "threads", 0, 1024)),
                          .progress = [&](double fraction) { return progress.report("prove", fraction, 0); }};
    const auto report = progress.run(callback, [&] { return verify(held.view, mesh.view, options); });
    if (!report) throw Failure{report.error(), about(report.error())};
    const auto point = [](const double(&p)[3]) { return nb::make_tuple(p[0], p[1], p[2]); };
    nb::list levels;
    for (const LevelProof& level : report->levels) {
        nb::dict one;
        one["covered"] = level.covered;
        one["counterexample"] = nb::none();
        if (level.has_counterexample) one["counterexample"] = point(level.point);
        one["depth"] = level.depth;
        one["pieces"] = level.pieces;
        levels.append(one);
    }
    nb::dict out;
    out["covered"] = report->covered;
    out["same_mesh"] = report->same_mesh;
    out["bounded"] = report->bounded;
    out["unbounded_node"] = report->bounded ? nb::none() : nb::cast(report->unbounded_node);
    out["holes_kept"] = report->holes_kept;
    out["blocked"] = nb::none();
    if (!report->holes_kept) out["blocked"] = point(report->blocked);
    out["inner_inside"] = report->inner_inside;
    out["protruding_node"] = report->inner_inside ? nb::none() : nb::cast(report->protruding_node);
    out["surface_mode"] = report->surface_mode;
    out["levels"] = nb::tuple(levels);
    return out;
}

ImportOptions import_options(nb::handle unit, nb::handle scale, nb::handle recentre) {
    ImportOptions out;
    if (!unit.is_none()) out.unit = number(unit, "unit");
    if (!scale.is_none()) {
        const Rows<double> factors = rows_of_doubles(scale, "scale", 3, true);
        std::copy(factors.values.begin(), factors.values.end(), out.scale.begin());
    }
    out.recentre = nb::cast<bool>(recentre);
    return out;
}

// (vertices, faces, (scale, origin), notes, files)
nb::tuple read_mesh(const nb::bytes& name, nb::handle unit, nb::handle scale, nb::handle recentre) {
    const ImportOptions options = import_options(unit, scale, recentre);
    const char* const path = name.c_str();
    ImportReport report;
    Progress progress;
    const auto mesh =
        progress.run(nb::none(), [&] { return load_mesh(path, options, &report, [&] { return progress.go_on(); }); });
    if (!mesh) {
        std::string detail =
            mesh.error().code == ErrorCode::io ? std::strerror(static_cast<int>(mesh.error().where)) : report.detail;
        throw Failure{mesh.error(), (detail.empty() ? "" : detail + ": ") + path};
    }
    const size_t n = mesh->vertices.size(), m = mesh->triangles.size();
    auto vertices = new_array<float>(3 * n);
    auto faces = new_array<uint32_t>(3 * m);
    if (n > 0) std::memcpy(vertices.get(), mesh->vertices.data(), n * sizeof(Vec3));
    if (m > 0) std::memcpy(faces.get(), mesh->triangles.data(), m * sizeof(Triangle));
    const auto three = [](const std::array<double, 3>& a) { return nb::make_tuple(a[0], a[1], a[2]); };
    const auto texts = [](const std::vector<std::string>& from) {
        nb::list out;
        for (const std::string& one : from) out.append(text_of(one));
        return out;
    };
    return nb::make_tuple(to_numpy(std::move(vertices), {n, 3}), to_numpy(std::move(faces), {m, 3}),
                          nb::make_tuple(three(mesh->placement.scale), three(mesh->placement.origin)),
                          texts(report.notes), texts(report.files));
}

nb::object file_hash(const nb::bytes& name, nb::handle unit, nb::handle scale, nb::handle recentre) {
    const ImportOptions options = import_options(unit, scale, recentre);
    const char* const path = name.c_str();
    const nb::gil_scoped_release released;
    const auto hash = hash_mesh_file(path, options);
    const nb::gil_scoped_acquire held;
    return hash ? nb::cast(*hash) : nb::none();
}

} // namespace

void bind_bake(nb::module_& m) {
    m.def("bake", &bake, nb::arg("vertices").none(), nb::arg("faces").none(), nb::arg("placement").none(),
          nb::arg("options"), nb::arg("progress").none());
    m.def("add_modes", &add_modes_to, nb::arg("tree").none(), nb::arg("vertices").none(), nb::arg("faces").none(),
          nb::arg("placement").none(), nb::arg("modes").none(), nb::arg("ranges").none());
    m.def("add_skin", &add_skin_to, nb::arg("tree").none(), nb::arg("vertices").none(), nb::arg("faces").none(),
          nb::arg("placement").none(), nb::arg("joints").none(), nb::arg("weights").none(), nb::arg("bones").none());
    m.def("options_hash", [](const nb::dict& options) { return hash(options_of(options)); });
    m.def("bake_key", &bake_key, nb::arg("vertices").none(), nb::arg("faces").none(), nb::arg("placement").none(),
          nb::arg("options"));
    m.def(
        "least_clearance",
        [](nb::handle diagonal, nb::handle quality) {
            return least_clearance(number_from_0(diagonal, "diagonal"), quality_of(quality));
        },
        nb::arg("diagonal").none(), nb::arg("quality").none());
    m.def(
        "ball_range",
        [](nb::handle longest_side) {
            const BallRange range = ball_range(number_from_0(longest_side, "longest_side"));
            return nb::make_tuple(range.least, range.most);
        },
        nb::arg("longest_side").none());
    m.def("verify", &verify_tree, nb::arg("tree").none(), nb::arg("vertices").none(), nb::arg("faces").none(),
          nb::arg("placement").none(), nb::arg("threads").none(), nb::arg("progress").none());
    m.def("load_mesh", &read_mesh, nb::arg("path"), nb::arg("unit").none(), nb::arg("scale").none(),
          nb::arg("recentre"));
    m.def("mesh_file_hash", &file_hash, nb::arg("path"), nb::arg("unit").none(), nb::arg("scale").none(),
          nb::arg("recentre"));
    m.def("save", [](const nb::bytes& name, nb::handle tree) {
        const HeldTree& held = tree_of(tree, "tree");
        const char* const path = name.c_str();
        const auto saved = [&] {
            const nb::gil_scoped_release released;
            return save(path, held.view.bytes());
        }();
        if (!saved)
            throw Failure{saved.error(),
                          std::string(std::strerror(static_cast<int>(saved.error().where))) + ": " + path};
    });
}

} // namespace prolate::python
