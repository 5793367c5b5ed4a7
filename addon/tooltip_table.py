# SPDX-License-Identifier: GPL-3.0-or-later
"""Tooltips in English, Japanese and Simplified Chinese."""

TOOLTIPS = (
    # Match.
    (
        "Find for every vertex of the targets the point of the source that it corresponds to",
        "転送先の各頂点に対応する転送元の点を求めます",
        "为目标的每个顶点找到来源上的对应点",
    ),
    (
        "Match the source to every target and carry the checked data over, in one go",
        "転送元をすべての転送先にマッチし、チェックしたデータをまとめて転送します",
        "一次完成：将来源与每个目标匹配，并传递已勾选的数据",
    ),
    (
        "Stop; nothing is changed, except that targets of a batch that are done already stay matched",
        "停止します。何も変更されませんが、一括処理で完了した転送先のマッチは残ります",
        "停止；不做任何更改，但批量中已完成的目标保持匹配",
    ),
    ("Hide this message", "このメッセージを隠します", "隐藏此消息"),
    (
        "Show the target as it was before the transfer, or with all that came and was done since",
        "転送前の転送先、または転送されたものとその後の変更を含む転送先を表示します",
        "显示传递之前的目标，或带有传递内容与此后更改的目标",
    ),
    (
        "Exchange source and target: the other mesh gives the data",
        "転送元と転送先を交換し、もう一方のメッシュからデータを転送します",
        "交换来源与目标：由另一网格提供数据",
    ),
    (
        "Keep this source and this target whatever is selected, or let the selection decide again",
        "選択に関わらずこの転送元と転送先を使うか、再び選択に従います",
        "无论选择什么都保持此来源与目标，或重新由选择决定",
    ),
    (
        "Keep these two objects whatever is selected. Else the active object is source and the other "
        "selected meshes are the targets",
        "選択に関わらずこの 2 つのオブジェクトを使います。オフでは、アクティブなものが転送元、他の"
        "選択メッシュが転送先です",
        "无论选择什么都保持这两个物体。否则活动物体为来源，其他所选网格为目标",
    ),
    (
        "The character that has the data to be carried over",
        "転送するデータを持つキャラクター",
        "拥有待传递数据的角色",
    ),
    ("The character that receives the data", "データを受け取るキャラクター", "接收数据的角色"),
    (
        "A collection whose meshes are the character that has the data",
        "データを渡すキャラクターのメッシュが入ったコレクション",
        "包含提供数据的角色网格的集合",
    ),
    (
        "A collection whose meshes are the character that receives the data",
        "データを受け取るキャラクターのメッシュが入ったコレクション",
        "包含接收数据的角色网格的集合",
    ),
    (
        "Match this mesh with its character, or leave it out",
        "このメッシュをキャラクターと一緒にマッチするか、除外します",
        "将此网格与其角色一起匹配，或将其排除",
    ),
    (
        "Let all meshes take part again that are neither hidden nor held in a hand",
        "非表示のものと手に持っているものを除き、すべてのメッシュを対象に戻します",
        "让所有网格重新参与，隐藏的和握在手中的除外",
    ),
    (
        "Takes part unless it is hidden or held in a hand",
        "非表示のものと手に持っているものを除き、対象になります",
        "参与匹配，除非隐藏或握在手中",
    ),
    ("Is matched with its character", "キャラクターと一緒にマッチします", "与其角色一起匹配"),
    (
        "Is left out when its character is matched",
        "キャラクターのマッチから除外します",
        "匹配其角色时被排除",
    ),
    (
        "Whether this mesh takes part when its character is matched",
        "キャラクターをマッチするとき、このメッシュを対象にするかどうか",
        "匹配角色时此网格是否参与",
    ),
    (
        "Match all meshes of a character together, whichever of them is chosen. Off: match the chosen "
        "meshes by themselves",
        "どれを選んでもキャラクターの全メッシュをまとめてマッチします。オフでは選んだメッシュだけをマッチし"
        "ます",
        "无论选中哪个，都将角色的所有网格一起匹配。关闭：仅匹配所选网格",
    ),
    (
        "Match the meshes as modelled, with rigs at rest, without modifiers and shape keys",
        "リグはレスト状態、モディファイアーとシェイプキーなしの元の形でマッチします",
        "按原始形状匹配：骨架处于静置姿态，不含修改器与形态键",
    ),
    (
        "Match the meshes as rigs, modifiers and shape keys show them now. Modifiers that add or remove "
        "vertices must be off",
        "リグ、モディファイアー、シェイプキーの現在の表示形でマッチします。頂点を増減するモディファイアーは"
        "オフにします",
        "按骨架、修改器与形态键当前显示的形状匹配。须关闭增减顶点的修改器",
    ),
    ("Which form of the meshes is compared", "比較するメッシュの形", "比较网格的哪种形状"),
    (
        "Decide from the shapes whether one is a part of the other",
        "一方が他方の一部かどうかを形から判定します",
        "根据形状判断一方是否为另一方的局部",
    ),
    (
        "The source is a piece of the target, for example a bust against a whole body",
        "転送元は転送先の一部です（例: 全身に対する胸像）",
        "来源是目标的一部分，例如半身像对全身",
    ),
    (
        "The target is a piece of the source, for example a hand against a whole body",
        "転送先は転送元の一部です（例: 全身に対する手）",
        "目标是来源的一部分，例如手对全身",
    ),
    (
        "Say so when one of the two is only a piece of the other",
        "一方が他方の一部である場合に指定します",
        "若两者之一只是另一方的局部，请在此指明",
    ),
    (
        "Also accept a match that turns left into right, as between a left and a right hand",
        "左手と右手のように、左右が反転するマッチも受け入れます",
        "也接受左右颠倒的匹配，例如左手与右手之间",
    ),
    (
        "Left, front and up are the same directions on both: tells the sides of a body apart that is its "
        "own mirror image",
        "左、前、上の向きが両者で同じです。左右対称な体の左右を区別します",
        "两者的左、前、上方向相同：用于区分左右对称身体的两侧",
    ),
    # Look and fix.
    (
        "Matching points of source and target have the same color",
        "転送元と転送先の対応点が同じ色になります",
        "来源与目标的对应点颜色相同",
    ),
    (
        "Blue where the match is sure, yellow where it is not",
        "マッチが確実な所は青、不確実な所は黄色",
        "匹配可靠处为蓝色，不可靠处为黄色",
    ),
    ("Color the viewport as before", "ビューポートの色を元に戻します", "恢复视图原来的颜色"),
    (
        "Color the two meshes in the viewport",
        "ビューポートで 2 つのメッシュに色を付けます",
        "在视图中为两个网格着色",
    ),
    (
        "Draw lines between points spread over the target and their places on the source: blue where the "
        "match is sure, yellow where it is not",
        "転送先の点と転送元の対応点を線で結びます。確実な所は青、不確実な所は黄色",
        "在目标各点与其来源位置之间画线：可靠处为蓝色，不可靠处为黄色",
    ),
    (
        "Give the target a Geometry Nodes modifier that moves every vertex to its place on the source, by "
        "a factor. Pressed again, take it away",
        "各頂点を係数に応じて転送元上の位置へ動かすジオメトリノードを転送先に付けます。もう一度押すと外しま"
        "す",
        "为目标添加几何节点修改器，按系数将每个顶点移到来源上的位置。再按一次则移除",
    ),
    (
        "Rest the pointer on one character and see the matching point on the other. Esc ends it",
        "一方のキャラクターにポインターを置くと、もう一方の対応点が見えます。Esc で終了",
        "将指针停在一个角色上，即可看到另一角色上的对应点。按 Esc 结束",
    ),
    ("Show what the matcher measured", "マッチの測定値を表示します", "显示匹配时的测量值"),
    (
        "Take the next of the maps that the match found. Useful when limbs, or front and back, are exchanged",
        "マッチで見つかった次のマップを使います。手足や前後が入れ替わった場合に有効です",
        "采用匹配找到的下一个映射。适用于肢体或前后颠倒的情况",
    ),
    (
        "1 for the next map, -1 for the previous one",
        "1 で次のマップ、-1 で前のマップ",
        "1 为下一个映射，-1 为上一个",
    ),
    (
        "Match again, this time to the map that exchanges left and right",
        "左右を入れ替えたマップで再マッチします",
        "重新匹配，这次采用交换左右的映射",
    ),
    (
        "Look for the map that exchanges left and right",
        "左右を入れ替えるマップを探します",
        "寻找交换左右的映射",
    ),
    (
        "Click a point on one mesh and the same point on the other, as often as you like. The next match "
        "takes the map that keeps them together",
        "一方のメッシュの点ともう一方の同じ点を、好きなだけクリックします。次のマッチはそれらを対応させます",
        "点击一个网格上的点，再点击另一网格上的同一点，可重复多次。下次匹配将使它们对应",
    ),
    ("Remove the chosen landmark", "選んだランドマークを削除します", "移除所选标志点"),
    (
        "Turn the view to the chosen landmark, seen from straight above the surface",
        "選んだランドマークを面の真上から見るようにビューを回します",
        "将视图转到所选标志点，从表面正上方观看",
    ),
    ("On the source", "転送元にある点", "来源上的点"),
    ("On the target", "転送先にある点", "目标上的点"),
    ("Chosen pair of landmarks", "選んだランドマークの組", "所选的标志点对"),
    # Transfer.
    (
        "Carry the checked data from the source to every matched target",
        "チェックしたデータを、マッチ済みのすべての転送先へ転送します",
        "将已勾选的数据从来源传递到每个已匹配的目标",
    ),
    ("Carry this over, or leave it behind", "これを転送するかどうかを切り替えます", "切换是否传递此项"),
    (
        "Fit with the outfit, or leave to the character, all that the search finds",
        "検索に合うものをすべて衣装に含めるか、キャラクターに残します",
        "将搜索到的全部项归入服装，或留给角色",
    ),
    (
        "Hide this piece of the target in viewport and render, or show it again. Nothing is deleted",
        "転送先のこの部分をビューポートとレンダーで隠すか、再び表示します。何も削除されません",
        "在视图和渲染中隐藏目标的这一部分，或重新显示。不会删除任何内容",
    ),
    (
        "Carry over, or leave behind, all that the search finds",
        "検索に合うものをまとめて、転送するかどうかを切り替えます",
        "传递或不传递搜索到的全部项",
    ),
    (
        "List only names with these letters",
        "この文字を含む名前だけを表示します",
        "只列出含有这些字母的名称",
    ),
    ("Show what needs a look", "確認が必要な点を表示します", "显示需要查看之处"),
    (
        "Move all matched meshes to their places on the source: 0 is the target's own shape, 1 the source's",
        "マッチしたすべてのメッシュを転送元の位置へ動かします。0 は転送先、1 は転送元の形です",
        "将所有已匹配的网格移到来源上的位置：0 为目标自身形状，1 为来源形状",
    ),
    (
        "Lay the source's shape over the target instead of moving it there",
        "転送先を動かさず、転送元の形をその場で重ねます",
        "不移动目标，而是将来源的形状叠加到目标上",
    ),
    (
        "Go over to the source's shape from one end of the body to the other",
        "体の一端から他端へ、転送元の形に切り替えます",
        "从身体一端到另一端过渡到来源的形状",
    ),
    ("Show what the source does not have", "転送元にない種類を表示します", "显示来源没有的种类"),
    ("Carry vertex groups and their weights", "頂点グループとウェイトを転送します", "传递顶点组及其权重"),
    (
        "Carry shape keys with their ranges, animation, drivers and masks",
        "シェイプキーを範囲、アニメーション、ドライバー、マスクごと転送します",
        "传递形态键及其范围、动画、驱动器与遮罩",
    ),
    (
        "Carry seams, sharp edges, creases and bevel weights along the curves they form",
        "シーム、シャープ、クリース、ベベルウェイトを、その線に沿って転送します",
        "沿其形成的曲线传递缝合边、锐边、折痕与倒角权重",
    ),
    (
        "Carry custom normals, which replace those of the target. Edges between which they differ become "
        "sharp",
        "カスタム法線を転送し、転送先のものを置き換えます。法線が異なる辺はシャープになります",
        "传递自定义法向并替换目标的法向。法向不同处的边变为锐边",
    ),
    (
        "Carry UV maps, cut where the source's seams fall",
        "UVマップを転送元のシームの位置で切って転送します",
        "传递 UV 贴图，并在来源缝合边处切开",
    ),
    (
        "Carry material slots and which face has which material",
        "マテリアルスロットと面ごとの割り当てを転送します",
        "传递材质槽以及各面所用材质",
    ),
    ("Carry painted colors", "塗られた色を転送します", "传递绘制的颜色"),
    (
        "Carry other attributes of points, edges, corners and faces",
        "点、辺、コーナー、面のその他の属性を転送します",
        "传递点、边、面拐与面的其他属性",
    ),
    (
        "Bake the source's image textures into the target's own UV layout. A target without one shows them "
        "by the source's UV map",
        "転送元の画像テクスチャを転送先のUV配置にベイクします。UVのない転送先は転送元のUVマップで表示します",
        "将来源的图像纹理烘焙到目标自身的 UV 布局。没有 UV 的目标按来源的 UV 贴图显示",
    ),
    (
        "Fit the source's armature to the target, which it then deforms",
        "転送元のアーマチュアを転送先に合わせ、変形させます",
        "使来源的骨架适配目标，并由其驱动变形",
    ),
    (
        "Copy eyes, teeth, clothes and hair that are objects of their own, fitted to the target",
        "別オブジェクトの目、歯、服、髪を、転送先に合わせてコピーします",
        "复制作为独立物体的眼、牙、衣服与头发，并适配目标",
    ),
    (
        "Give the fitted rig copies of the actions, fitted to the target's rest pose and the length of its "
        "legs. Off: they play as they are",
        "転送先のレストポーズと脚の長さに合わせたアクションのコピーを使います。オフではそのまま再生します",
        "为适配后的绑定提供动作副本，按目标的静置姿态与腿长调整。关闭：按原样播放",
    ),
    (
        "Make movements larger or smaller with the parts they move. Off: turn them only",
        "動く部分の大きさに応じて動きを拡縮します。オフでは向きだけ変えます",
        "动作幅度随所移动部分的大小缩放。关闭：仅旋转方向",
    ),
    (
        "What a key brings together, as lids or lips, meets on the target too. Off, or where movements are "
        "turned only: it may stay apart or overlap",
        "まぶたや唇のように、キーで合わさる部分を転送先でも合わせます。オフのとき、または動きの向きだけを変える"
        "ときは、離れたままになったり重なったりすることがあります",
        "形态键使其合拢的部分（如眼睑或嘴唇）在目标上也会合拢。关闭时，或动作只作旋转时：可能留有缝隙或重叠",
    ),
    (
        "Make no keys that move nothing on the target, as those of a face on a shirt. Keys that move "
        "nothing on the source are carried",
        "シャツに対する顔のキーのように、転送先で何も動かさないキーは作りません。転送元で動かないキーは転送"
        "します",
        "不创建在目标上不移动任何东西的键，如衬衫上的面部键。来源上本就无变化的键照常传递",
    ),
    (
        "UV map of the target to bake into. Empty: the active one, or the first other one where the "
        "source's comes in its place",
        "ベイク先の転送先UVマップ。空の場合はアクティブなもの、それが置き換わる場合は最初の別のもの",
        "烘焙到的目标 UV 贴图。留空：使用活动项；若其被来源替换，则用首个其他贴图",
    ),
    (
        "When to give the target a new UV map by Smart UV Project, beside its own, and bake into that",
        "スマートUV投影で転送先に新しい UVマップを追加し、そこへベイクする条件。既存のものは残ります",
        "何时用智能 UV 投射为目标添加新的 UV 贴图并烘焙到其中；原有贴图保留",
    ),
    (
        "Bake into a UV map of its own in any case",
        "常に既存の UVマップへベイクします",
        "始终烘焙到原有 UV 贴图",
    ),
    (
        "Where places that should look different share texels of its own UV map, as in a palette, or where "
        "nothing else shows the textures",
        "既存の UVマップで別の絵になるべき場所が同じテクセルを使う場合（パレットなど）、"
        "または他にテクスチャを表示する方法がない場合",
        "原有 UV 贴图中本应不同的部位共用纹素（如调色板），或没有其他方式显示纹理时",
    ),
    (
        "Where its own UV map overlaps at all, or it has none",
        "既存の UVマップが重なっているか、存在しない場合",
        "原有 UV 贴图有任何重叠，或没有 UV 贴图时",
    ),
    ("Size of the baked images", "ベイクする画像のサイズ", "烘焙图像的尺寸"),
    (
        "Pixels by which islands are extended into the empty space around them",
        "アイランドを周囲の空白へ広げるピクセル数",
        "孤岛向周围空白扩展的像素数",
    ),
    (
        "Give the target copies of the materials that show the baked images",
        "ベイクした画像を表示するマテリアルのコピーを転送先に付けます",
        "为目标提供显示烘焙图像的材质副本",
    ),
    (
        "Mark the target's edges as seams where the carried UV map is cut. Those that are seams already "
        "stay seams",
        "転送したUVマップの切れ目にある辺をシームにします。既存のシームは残ります",
        "将所传递 UV 贴图切口处的边标记为缝合边。已有缝合边保留",
    ),
    (
        "Write over UV maps of the target that have the names of the source's. Off: those stay, and the "
        "source's come beside them",
        "転送元と同名のUVマップを上書きします。オフでは残し、転送元のものを別に追加します",
        "覆盖目标中与来源同名的 UV 贴图。关闭：保留原有，来源的另行添加",
    ),
    (
        "Cut the faces of a target that has no UV map of its own where a seam of the source runs through "
        "them, so that textures fit. Off: its topology stays",
        "UVマップのない転送先の面を、転送元のシームが通る所で切り、テクスチャを合わせます。オフではトポロジ"
        "ーを保ちます",
        "对没有 UV 贴图的目标，在来源缝合边穿过处切开面，使纹理吻合。关闭：保持拓扑",
    ),
    (
        "Cut the target's faces where a seam of the source runs through them, whatever UV maps it has. "
        "Changes the target's topology: it gets more vertices and faces",
        "UVマップに関わらず、転送元のシームが通る所で面を切ります。転送先の頂点と面が増えます",
        "无论目标有何 UV 贴图，都在来源缝合边穿过处切开面。目标拓扑会改变：顶点与面增多",
    ),
    (
        "Keep only the strongest weights of each vertex",
        "各頂点の最も強いウェイトだけを残します",
        "只保留每个顶点最强的权重",
    ),
    ("Game engines usually take 4", "ゲームエンジンでは通常 4 です", "游戏引擎通常为 4"),
    (
        "Scale each vertex's weights back to the sum that came across: 1 if the source's weights sum to 1",
        "各頂点のウェイトの合計を、転送された合計に合わせます。転送元の合計が 1 なら 1 になります",
        "将每个顶点的权重缩放回传来的总和：来源总和为 1 则为 1",
    ),
    (
        "How much of the source's weights the groups get; the rest is what they have",
        "グループが受け取る転送元のウェイトの割合。残りは元の値です",
        "顶点组取来源权重的比例；其余为原有权重",
    ),
    (
        "On a target with a rig, weights of its other bones make room for what is carried, so that they "
        "sum to 1. Locked groups stay",
        "リグのある転送先で、他のボーンのウェイトを減らして合計を 1 にします。ロックしたグループは"
        "変わりません",
        "目标已有绑定时，降低其他骨骼的权重，使其与传来的权重之和为 1。锁定的组不变",
    ),
    (
        "Replaced where Armature is carried, else kept",
        "アーマチュアを転送する場合は置換、しない場合は維持",
        "传递骨架时替换，否则保留",
    ),
    (
        "The source's rig takes its place where Armature is carried; its own stays, with the modifier off "
        "and its groups beside the new ones",
        "アーマチュアを転送する場合、転送元のリグに置き換わります。元のリグはモディファイアーをオフにして残"
        "ります",
        "传递骨架时由来源的绑定取代；原绑定保留，其修改器关闭，原有组与新组并存",
    ),
    (
        "It stays, and weights go to those of its bones that hold the same surface",
        "元のリグを残し、同じ面を持つボーンへウェイトを転送します",
        "保留原绑定，权重分给其中控制同一表面的骨骼",
    ),
    (
        "What becomes of a rig that the target has already",
        "転送先に既にあるリグの扱い",
        "目标已有的绑定如何处理",
    ),
    ("Drop weights smaller than this", "これより小さいウェイトを除きます", "舍弃小于此值的权重"),
    (
        "Rounds of smoothing along the target's surface",
        "転送先の面に沿ったスムージングの回数",
        "沿目标表面平滑的次数",
    ),
    (
        "Where the match is less sure than this, fill weights from the surroundings instead; 0 takes every "
        "image",
        "マッチの信頼度がこれ未満の所は、周囲からウェイトを補います。0 ではすべて採用します",
        "匹配的置信度低于此值处，改由周围填充权重；0 表示全部采用",
    ),
    (
        "Exchange left and right, however they are written, in the names of vertex groups, shape keys and "
        "bones: for a match that turned left into right",
        "左右が反転したマッチのため、頂点グループ、シェイプキー、ボーンの名前の左右を入れ替えます",
        "交换顶点组、形态键与骨骼名称中的左右（无论写法）：用于左右颠倒的匹配",
    ),
    (
        "A vertex group of the target: only its vertices are written. Empty: all are",
        "転送先の頂点グループ。その頂点だけに書き込みます。空の場合はすべて",
        "目标的顶点组：只写入其顶点。留空：全部写入",
    ),
    # Settings.
    (
        "Keep the settings of match and transfer under a name, or remove the chosen preset",
        "マッチと転送の設定を名前を付けて保存するか、選んだプリセットを削除します",
        "以名称保存匹配与传递的设置，或移除所选预设",
    ),
    (
        "Set everything about match and transfer back to its default. Objects, landmarks and matches stay",
        "マッチと転送の設定をすべて初期値に戻します。オブジェクト、ランドマーク、マッチは残ります",
        "将匹配与传递的所有设置恢复默认。物体、标志点与匹配保留",
    ),
    (
        "Remove all prepared meshes from the cache folder. The next match of each mesh takes its full time",
        "キャッシュフォルダーの準備済みメッシュをすべて削除します。次のマッチは最初から計算します",
        "从缓存文件夹中移除所有预处理网格。各网格下次匹配需要完整时间",
    ),
    (
        "Processor threads a match may use; 0 takes all. The result does not depend on it",
        "マッチに使うスレッド数。0 ではすべて使います。結果は変わりません",
        "匹配可用的处理器线程数；0 为全部。结果与此无关",
    ),
    ("Search for the best map and refine it", "最良のマップを探して調整します", "搜索最佳映射并加以细化"),
    (
        "The published algorithm and nothing else: for comparison in research, less exact and slower",
        "論文のアルゴリズムのみ。研究での比較用で、精度が低く遅くなります",
        "仅用已发表的算法：供研究比较，精度较低且较慢",
    ),
    ("How every match is computed", "マッチの計算方法", "匹配的计算方式"),
    (
        "Color both meshes so that matching points have the same color",
        "対応点が同じ色になるように両方のメッシュに色を付けます",
        "为两个网格着色，使对应点颜色相同",
    ),
    (
        "Color the targets by how sure the match is",
        "マッチの信頼度で転送先に色を付けます",
        "按匹配的置信度为目标着色",
    ),
    ("Do not touch the viewport", "ビューポートを変えません", "不改动视图"),
    (
        "What the viewport shows when a match is done",
        "マッチ完了後にビューポートに表示するもの",
        "匹配完成后视图显示的内容",
    ),
    (
        "Keep what was computed of each mesh on disk, so that its next match starts half done, in another "
        "session too",
        "各メッシュの計算結果をディスクに保存し、次のマッチを途中から始めます（再起動後も有効）",
        "将每个网格的计算结果存到磁盘，使下次匹配只需计算其余部分，重启后亦然",
    ),
    (
        "Where prepared meshes are kept, in a sub-folder sgmds-shapes; other files there are left alone. "
        "Empty is a folder of this extension's own",
        "準備済みメッシュの保存先（サブフォルダー sgmds-shapes）。他のファイルには触れません。空の場合は専用"
        "フォルダー",
        "预处理网格的保存位置（子文件夹 sgmds-shapes）；其他文件不受影响。留空则用本扩展自己的文件夹",
    ),
    (
        "When prepared meshes take more than this, those used longest ago are removed. A mesh of 20,000 "
        "vertices takes 0.013",
        "これを超えると、最も長く使われていないものから削除します。20,000 頂点のメッシュは 0.013 です",
        "预处理网格超过此大小时，移除最久未用者。20,000 个顶点的网格占 0.013",
    ),
    (
        "Added to the distance between skin and cloth. Outfits fitted since the file was opened "
        "follow at once",
        "肌と布の距離に加えます。ファイルを開いてから合わせた衣装はすぐに追従します",
        "加到皮肤与布料的距离上。打开文件后适配的服装会立即跟随",
    ),
    (
        "Belongs to its character's body",
        "キャラクターの体に属します",
        "属于角色的身体",
    ),
    (
        "Color fitted outfits by their distance to the skin: blue where it is as large as asked, yellow "
        "where they are inside the body. Pressed again, color the viewport as before",
        "合わせた衣装を肌からの距離で色分けします。青は指定どおり、黄色は体の内側です。もう一度押"
        "すと元の表示に戻ります",
        "按与皮肤的距离为已适配的服装着色：蓝色为所需距离，黄色为在身体内。再按一次恢复视图",
    ),
    (
        "Fit this object with the outfit, or leave it to the character",
        "このオブジェクトを衣装として合わせるか、キャラクターに残します",
        "将此物体作为服装适配，或留给角色",
    ),
    (
        "Give the outfit shape keys, driven by those of the target that move skin under it",
        "下の肌を動かす転送先のシェイプキーで駆動されるキーを衣装に作ります",
        "为服装创建形态键，由移动其下皮肤的目标形态键驱动",
    ),
    (
        "How much of the distance between skin and cloth is taken away; below zero it grows. Outfits "
        "fitted since the file was opened follow at once",
        "肌と布の距離を減らす割合。負の値では広がります。ファイルを開いてから合わせた衣装はすぐに追従します",
        "减去皮肤与布料距离的比例；负值则增大。打开文件后适配的服装会立即跟随",
    ),
    (
        "Is fitted with its character's outfit",
        "キャラクターの衣装として合わせます",
        "作为角色的服装一起适配",
    ),
    (
        "Show how this is carried, and each of its items",
        "転送の方法と、それぞれの項目を表示します",
        "显示此项如何传递及其各个项目",
    ),
    (
        "List what the source wears",
        "転送元が着ているものを一覧表示します",
        "列出来源所穿的物体",
    ),
    (
        "Put copies of what the source wears onto every matched target: fitted, rigged and moving with it",
        "転送元が着ているもののコピーを、マッチしたすべての転送先に合わせ、リグを付けて一緒に動くように"
        "します",
        "将来源所穿物体的副本穿到每个已匹配目标上：已适配、已绑定并随之运动",
    ),
    (
        "Put what nobody sees of the target under the outfit into a vertex group, which a Mask "
        "modifier leaves out. Nothing is deleted",
        "衣装の下で見えない転送先の面を頂点グループに入れ、マスクモディファイアーで隠します。何も削除し"
        "ません",
        "将目标在服装下不可见的部分放入顶点组，由遮罩修改器隐藏。不会删除任何内容",
    ),
    (
        "Whether this mesh is clothing of its character",
        "このメッシュがキャラクターの衣装かどうか",
        "此网格是否为角色的服装",
    ),
    (
        "Worn where it lies over other meshes, unless small or hidden",
        "他のメッシュを覆っていれば着用とみなします（小さいものや非表示のものを除く）",
        "覆盖在其他网格之上即视为穿着，过小或隐藏的除外",
    ),
    ("Set Shape to Original first", "先に形状を「オリジナル」にします", "先将形状设为“原始”"),
    (
        "Leave out hats, hair and clothes that lie over other meshes: bodies alone match more exactly",
        "他のメッシュを覆う帽子・髪・服を除外します。体だけの方が正確にマッチします",
        "排除覆盖在其他网格之上的帽子、头发和衣服：只匹配身体更准确",
    ),
    (
        "First leave out hats, hair and clothes that lie over other meshes of their character",
        "先に、同じキャラクターの他のメッシュを覆う帽子・髪・服を除外します",
        "先排除覆盖在同一角色其他网格之上的帽子、头发和衣服",
    ),
    (
        "Check Allow Mirrored Match first",
        "先に「ミラーマッチを許可」をオンにします",
        "先勾选“允许镜像匹配”",
    ),
    (
        "Show this object in the viewport, with the collections that it is in",
        "このオブジェクトを、入っているコレクションごとビューポートに表示します",
        "在视图中显示此物体及其所在集合",
    ),
    (
        "Give this object the scale 1 along each axis that is scaled to nothing",
        "スケールが 0 の軸を 1 にします",
        "将此物体缩放为 0 的各轴设为 1",
    ),
    (
        "Remove the landmarks of this pair whose mesh got other vertices since they were picked",
        "指定後に頂点が変わったメッシュのランドマークを削除します",
        "移除选取后网格顶点已更改的标志点",
    ),
    ("As large as the source's image", "転送元の画像と同じ大きさ", "与来源图像同样大小"),
)
