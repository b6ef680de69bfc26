// One run of CGAL's edge collapse: peer-cgal lt|gh IN OUT TARGET [RATIO]
//
// IN and OUT are raw meshes (bench/src/raw.rs). CGAL stops at a ratio of EDGES; without RATIO one is searched whose faces are within 0.5 % of the
// target. Prints one line of JSON. Exit code 1 and a message: CGAL does not take this mesh.
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/Bounded_normal_change_placement.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/Count_ratio_stop_predicate.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/GarlandHeckbert_policies.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/LindstromTurk_cost.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/LindstromTurk_placement.h>
#include <CGAL/Surface_mesh_simplification/edge_collapse.h>
#include <CGAL/version.h>

#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iostream>
#include <string>
#include <vector>

namespace sms = CGAL::Surface_mesh_simplification;
namespace pmp = CGAL::Polygon_mesh_processing;
using Kernel = CGAL::Simple_cartesian<double>;
using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;
using Clock = std::chrono::steady_clock;

struct Soup {
    std::vector<Kernel::Point_3> points;
    std::vector<std::array<std::size_t, 3>> triangles;
};

static double since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

[[noreturn]] static void fail(const std::string& why) {
    std::cerr << why << "\n";
    std::exit(1);
}

static Soup read(const char* path) {
    std::ifstream file(path, std::ios::binary);
    char magic[8];
    std::uint64_t counts[2];
    if (!file.read(magic, 8) || std::memcmp(magic, "PMRAW001", 8) != 0) fail("not a raw mesh");
    file.read(reinterpret_cast<char*>(counts), sizeof counts);
    std::vector<double> xyz(3 * counts[0]);
    std::vector<std::uint32_t> ids(3 * counts[1]);
    file.read(reinterpret_cast<char*>(xyz.data()), xyz.size() * sizeof(double));
    file.read(reinterpret_cast<char*>(ids.data()), ids.size() * sizeof(std::uint32_t));
    if (!file) fail("the raw mesh is cut short");
    Soup soup;
    for (std::size_t i = 0; i < counts[0]; ++i) soup.points.emplace_back(xyz[3 * i], xyz[3 * i + 1], xyz[3 * i + 2]);
    for (std::size_t i = 0; i < counts[1]; ++i) soup.triangles.push_back({ids[3 * i], ids[3 * i + 1], ids[3 * i + 2]});
    return soup;
}

static void write(const char* path, const std::vector<double>& xyz, const std::vector<std::uint32_t>& ids) {
    std::ofstream file(path, std::ios::binary);
    const std::uint64_t counts[2] = {xyz.size() / 3, ids.size() / 3};
    file.write("PMRAW001", 8);
    file.write(reinterpret_cast<const char*>(counts), sizeof counts);
    file.write(reinterpret_cast<const char*>(xyz.data()), xyz.size() * sizeof(double));
    file.write(reinterpret_cast<const char*>(ids.data()), ids.size() * sizeof(std::uint32_t));
    if (!file) fail("cannot write the result");
}

static void collapse(Mesh& mesh, double ratio, bool garland_heckbert) {
    const sms::Count_ratio_stop_predicate<Mesh> stop(ratio);
    if (!garland_heckbert) {
        // CGAL's default cost and placement: Lindstrom-Turk.
        sms::edge_collapse(mesh, stop);
        return;
    }
    // As CGAL's own example: placements that flip a normal are refused.
    using Policies = sms::GarlandHeckbert_plane_policies<Mesh, Kernel>;
    const Policies policies(mesh);
    const sms::Bounded_normal_change_placement<Policies::Get_placement> placement(policies.get_placement());
    sms::edge_collapse(mesh, stop, CGAL::parameters::get_cost(policies.get_cost()).get_placement(placement));
}

static long long peak_bytes() {
    std::ifstream status("/proc/self/status");
    for (std::string line; std::getline(status, line);)
        if (line.rfind("VmHWM:", 0) == 0) return 1024 * std::atoll(line.c_str() + 6);
    return -1;
}

int main(int count, char** arguments) {
    if (count == 2 && std::string(arguments[1]) == "--version") {
        std::cout << CGAL_VERSION_STR << "\n";
        return 0;
    }
    if (count < 5) fail("peer-cgal lt|gh IN OUT TARGET [RATIO]");
    const bool garland_heckbert = std::string(arguments[1]) == "gh";
    const Soup soup = read(arguments[2]);
    const double target = std::atof(arguments[4]);
    if (!pmp::is_polygon_soup_a_polygon_mesh(soup.triangles)) fail("CGAL refuses this mesh: it is not manifold, or not oriented");

    const bool search = count < 6;
    double ratio = search ? target / soup.triangles.size() : std::atof(arguments[5]);
    double seconds = 0, arrays = 0;
    std::vector<double> xyz;
    std::vector<std::uint32_t> ids;
    // The ratio that leaves too few faces, and the one that leaves too many.
    double low = 0, high = 1;
    int rounds = 0;
    while (rounds < 12) {
        ++rounds;
        const auto start = Clock::now();
        Mesh mesh;
        pmp::polygon_soup_to_polygon_mesh(soup.points, soup.triangles, mesh);
        const auto inner = Clock::now();
        collapse(mesh, ratio, garland_heckbert);
        seconds = since(inner);
        mesh.collect_garbage();
        xyz.clear();
        ids.clear();
        for (auto v : mesh.vertices())
            for (int k = 0; k < 3; ++k) xyz.push_back(mesh.point(v)[k]);
        for (auto f : mesh.faces())
            for (auto v : vertices_around_face(mesh.halfedge(f), mesh)) ids.push_back(static_cast<std::uint32_t>(v));
        arrays = since(start);
        const double faces = static_cast<double>(mesh.number_of_faces());
        if (!search || faces == 0 || std::abs(faces / target - 1) <= 0.005) break;
        (faces < target ? low : high) = ratio;
        const double next = ratio * target / faces;
        ratio = low < next && next < high ? next : 0.5 * (low + high);
    }
    write(arguments[3], xyz, ids);
    const long long peak = peak_bytes();
    std::printf("{\"call_seconds\": %.9f, \"arrays_seconds\": %.9f, \"triangles\": %zu, \"parameter\": %.17g, \"rounds\": %d", seconds,
                arrays, ids.size() / 3, ratio, rounds);
    if (peak >= 0) std::printf(", \"peak_bytes\": %lld", peak);
    std::printf("}\n");
    return 0;
}
